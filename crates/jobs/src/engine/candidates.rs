//! The clients with waiting jobs (`client`) in the order in which they are served, at most `$1`, with the attempts of the first job of each
//! (`attempt`) and how many jobs of each run (`running`).
//!
//! A client of whom the fewest jobs run comes first; among those, the one whose first job has the highest priority; then the one whose first job is
//! oldest.
//!
//! The statements jump along the index of waiting jobs from the first job of a client to that of the next one (a skip-scan), so their time grows
//! with the clients that have waiting jobs, and not with the jobs. The order of every jump is that of the index `jobs_waiting`, so that no
//! other index is better at it. The databases have no jump in common: a row of PostgreSQL's LATERAL query is a job number and a look-up in SQLite.

pub(super) const SQLITE: &str = "
    WITH RECURSIVE heads (number) AS (
        SELECT (SELECT number FROM jobs INDEXED BY jobs_waiting WHERE state = 'waiting'
            ORDER BY client, priority DESC, number LIMIT 1)
        UNION ALL
        SELECT (SELECT later.number FROM jobs later INDEXED BY jobs_waiting
            WHERE later.state = 'waiting' AND later.client > head.client
            ORDER BY later.client, later.priority DESC, later.number LIMIT 1)
        FROM heads JOIN jobs head ON head.number = heads.number
    ),
    loads (client, running) AS (
        SELECT client, count(*) FROM jobs WHERE state = 'running' GROUP BY client
    )
    SELECT head.client AS client, head.attempt AS attempt, coalesce(loads.running, 0) AS running
    FROM heads JOIN jobs head ON head.number = heads.number LEFT JOIN loads ON loads.client = head.client
    ORDER BY coalesce(loads.running, 0), head.priority DESC, head.number LIMIT $1";

pub(super) const POSTGRES: &str = "
    WITH RECURSIVE heads (client, priority, number, attempt) AS (
        (SELECT client, priority, number, attempt FROM jobs WHERE state = 'waiting'
            ORDER BY client, priority DESC, number LIMIT 1)
        UNION ALL
        SELECT later.client, later.priority, later.number, later.attempt
        FROM heads CROSS JOIN LATERAL (
            SELECT client, priority, number, attempt FROM jobs WHERE state = 'waiting' AND client > heads.client
            ORDER BY client, priority DESC, number LIMIT 1
        ) later
    ),
    loads (client, running) AS (
        SELECT client, count(*) FROM jobs WHERE state = 'running' GROUP BY client
    )
    SELECT heads.client AS client, heads.attempt AS attempt, coalesce(loads.running, 0) AS running
    FROM heads LEFT JOIN loads ON loads.client = heads.client
    ORDER BY coalesce(loads.running, 0), heads.priority DESC, heads.number LIMIT $1";

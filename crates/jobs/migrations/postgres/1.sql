-- The tables in PostgreSQL; `../sqlite/1.sql` has the same ones.
-- Times are the server's: the clocks of the machines differ.
CREATE FUNCTION darn_now() RETURNS BIGINT LANGUAGE sql STABLE AS
$$ SELECT CAST(floor(extract(epoch FROM statement_timestamp()) * 1000) AS BIGINT) $$;

CREATE TABLE jobs (
    number BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    id UUID NOT NULL UNIQUE,
    client TEXT COLLATE "C" NOT NULL,
    idempotency_key TEXT,
    digest TEXT NOT NULL,
    name TEXT,
    priority BIGINT NOT NULL,
    webhook TEXT,
    request TEXT NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('waiting', 'running', 'done', 'error', 'cancelled')),
    version BIGINT NOT NULL,
    attempt BIGINT NOT NULL,
    cancel_wanted BIGINT NOT NULL DEFAULT 0 CHECK (cancel_wanted IN (0, 1)),
    lease UUID,
    lease_until BIGINT,
    worker TEXT,
    stage TEXT,
    hole BIGINT,
    holes BIGINT,
    created_at BIGINT NOT NULL,
    changed_at BIGINT NOT NULL,
    started_at BIGINT,
    finished_at BIGINT,
    expired_at BIGINT,
    input TEXT,
    result TEXT,
    report TEXT,
    bytes BIGINT NOT NULL,
    answer TEXT,
    failure_code TEXT,
    failure_message TEXT,
    CHECK ((state = 'running') = (lease IS NOT NULL)),
    CHECK ((state = 'running') = (lease_until IS NOT NULL)),
    CHECK ((state IN ('done', 'error', 'cancelled')) = (finished_at IS NOT NULL))
) WITH (
    -- A queue's rows change often and soon: leave room for that in their pages, and clean up early.
    fillfactor = 70,
    autovacuum_vacuum_scale_factor = 0.01,
    autovacuum_vacuum_threshold = 1000,
    autovacuum_analyze_scale_factor = 0.02
);

-- A client's key names one job.
CREATE UNIQUE INDEX jobs_by_key ON jobs (client, idempotency_key) WHERE idempotency_key IS NOT NULL;
-- The claim jumps along it from client to client. No other index has waiting jobs of a client together, so that none is taken for it.
CREATE INDEX jobs_waiting ON jobs (client, priority DESC, number) WHERE state = 'waiting';
CREATE INDEX jobs_running ON jobs (client) WHERE state = 'running';
CREATE INDEX jobs_finished ON jobs (finished_at, number, state) WHERE state IN ('done', 'error', 'cancelled');
-- Lists.
CREATE INDEX jobs_of_client ON jobs (client, number);
CREATE INDEX jobs_of_client_finished ON jobs (client, state, number) WHERE state IN ('done', 'error', 'cancelled');

-- Work that one process does for all of them from time to time.
CREATE TABLE chores (
    name TEXT PRIMARY KEY,
    next_at BIGINT NOT NULL
);

-- Ends of jobs that somebody wants to be told of. A row is written in the transaction that ends the job, so no end is missed and none is
-- told that did not happen. Its id for the receiver is the job with its version.
CREATE TABLE outbox (
    job UUID NOT NULL,
    version BIGINT NOT NULL,
    client TEXT NOT NULL,
    webhook TEXT NOT NULL,
    state TEXT NOT NULL,
    created_at BIGINT NOT NULL,
    tries BIGINT NOT NULL DEFAULT 0,
    next_try_at BIGINT NOT NULL,
    PRIMARY KEY (job, version)
);
CREATE INDEX outbox_by_time ON outbox (next_try_at);

CREATE FUNCTION jobs_ended() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO outbox (job, version, client, webhook, state, created_at, next_try_at)
    VALUES (new.id, new.version, new.client, new.webhook, new.state, new.finished_at, new.finished_at);
    RETURN NULL;
END $$;

CREATE TRIGGER jobs_ended AFTER UPDATE OF state ON jobs FOR EACH ROW
WHEN (new.webhook IS NOT NULL AND old.finished_at IS NULL AND new.finished_at IS NOT NULL)
EXECUTE FUNCTION jobs_ended();

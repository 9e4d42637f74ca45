-- The outbox of webhooks: who tries to deliver a row, what came of the tries, and when the next one is due. Nothing wrote to the table of
-- step 1, since no submission could name a webhook. `../sqlite/2.sql` has the same table.

DROP TRIGGER jobs_ended ON jobs;
DROP FUNCTION jobs_ended;
DROP TABLE outbox;

-- Ends of jobs that somebody wants to be told of. A row is written in the transaction that ends the job, so no end is missed and none is
-- told that did not happen; it is deleted with its job. Its id for the receiver is the job with its version.
CREATE TABLE outbox (
    job UUID NOT NULL,
    version BIGINT NOT NULL,
    client TEXT NOT NULL,
    name TEXT,
    webhook TEXT NOT NULL,
    state TEXT NOT NULL,
    ended_at BIGINT NOT NULL,
    outcome TEXT NOT NULL DEFAULT 'waiting' CHECK (outcome IN ('waiting', 'delivered', 'given_up', 'disabled')),
    tries BIGINT NOT NULL DEFAULT 0,
    -- When a row that is claimed may be claimed again.
    next_try_at BIGINT,
    lease UUID,
    last_try_at BIGINT,
    last_status BIGINT,
    last_error TEXT,
    PRIMARY KEY (job, version),
    CHECK ((outcome = 'waiting') = (next_try_at IS NOT NULL))
);
CREATE INDEX outbox_due ON outbox (next_try_at) WHERE next_try_at IS NOT NULL;

CREATE FUNCTION jobs_ended() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO outbox (job, version, client, name, webhook, state, ended_at, next_try_at)
    SELECT new.id, new.version, new.client, new.name, new.webhook, new.state, new.finished_at, new.finished_at
    WHERE NOT EXISTS (SELECT 1 FROM outbox WHERE job = new.id AND outcome = 'disabled');
    RETURN NULL;
END $$;

CREATE TRIGGER jobs_ended AFTER UPDATE OF state ON jobs FOR EACH ROW
WHEN (new.webhook IS NOT NULL AND old.finished_at IS NULL AND new.finished_at IS NOT NULL)
EXECUTE FUNCTION jobs_ended();

CREATE FUNCTION jobs_deleted() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    DELETE FROM outbox WHERE job = old.id;
    RETURN NULL;
END $$;

CREATE TRIGGER jobs_deleted AFTER DELETE ON jobs FOR EACH ROW WHEN (old.webhook IS NOT NULL) EXECUTE FUNCTION jobs_deleted();

-- The processes that serve together, and until when each counts as alive.
CREATE TABLE instances (
    name TEXT PRIMARY KEY,
    alive_until BIGINT NOT NULL
);

-- Where a job was handed over, as a value of `traceparent` (W3C Trace Context).
ALTER TABLE jobs ADD COLUMN trace TEXT;

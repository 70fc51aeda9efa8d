-- What was watched. A store gets these tables with its first watched log.
CREATE TABLE IF NOT EXISTS watched_property (
  stage_id INTEGER NOT NULL REFERENCES stage (id),
  time_utc TEXT NOT NULL,
  property TEXT NOT NULL,
  kind TEXT NOT NULL,
  value DOUBLE PRECISION NOT NULL,
  change DOUBLE PRECISION NOT NULL,
  deviation DOUBLE PRECISION NOT NULL,
  PRIMARY KEY (stage_id, property, time_utc)
) WITHOUT ROWID;
CREATE VIEW IF NOT EXISTS watched AS
  SELECT s.name AS stage, w.time_utc, w.property, w.kind, w.value, w.change, w.deviation
  FROM watched_property w JOIN stage s ON s.id = w.stage_id;

-- The tables of the store of a fleet, described for users in docs/formats.md. In the words of SQLite, which
-- Database::create() translates for PostgreSQL.
CREATE TABLE store (format TEXT NOT NULL, schema_version INTEGER NOT NULL);
CREATE TABLE stage (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE,
  changed INTEGER NOT NULL
);
CREATE TABLE channels (
  id INTEGER PRIMARY KEY,
  outputs TEXT NOT NULL,
  inputs TEXT NOT NULL,
  UNIQUE (outputs, inputs)
);
CREATE TABLE configuration (
  id INTEGER PRIMARY KEY,
  text TEXT NOT NULL UNIQUE
);
CREATE TABLE identification (
  id INTEGER PRIMARY KEY,
  job TEXT NOT NULL UNIQUE,
  stage_id INTEGER NOT NULL REFERENCES stage (id),
  time_utc TEXT NOT NULL,
  is_current INTEGER NOT NULL,
  verdict TEXT NOT NULL,
  reasons TEXT,
  outlier TEXT,
  relative_rms_error DOUBLE PRECISION,
  health TEXT,
  log TEXT NOT NULL,
  log_fingerprint TEXT NOT NULL,
  version TEXT NOT NULL,
  configuration_id INTEGER NOT NULL REFERENCES configuration (id),
  channels_id INTEGER REFERENCES channels (id),
  results TEXT
);
CREATE INDEX identification_by_stage ON identification (stage_id, time_utc);
CREATE INDEX identification_by_log ON identification (log_fingerprint);
CREATE INDEX failed_log ON identification (log) WHERE verdict = 'failed';
CREATE TABLE mode (
  identification_id INTEGER NOT NULL REFERENCES identification (id),
  number INTEGER NOT NULL,
  track INTEGER,
  frequency_hz DOUBLE PRECISION NOT NULL,
  frequency_std_hz DOUBLE PRECISION,
  damping_ratio DOUBLE PRECISION NOT NULL,
  damping_ratio_std DOUBLE PRECISION,
  deviation DOUBLE PRECISION,
  modal_mass DOUBLE PRECISION,
  shape_std DOUBLE PRECISION,
  shape BLOB,
  PRIMARY KEY (identification_id, number)
) WITHOUT ROWID;
CREATE TABLE tag (
  identification_id INTEGER NOT NULL REFERENCES identification (id),
  name TEXT NOT NULL,
  text TEXT NOT NULL,
  number DOUBLE PRECISION,
  PRIMARY KEY (identification_id, name)
) WITHOUT ROWID;
CREATE TABLE track (
  stage_id INTEGER NOT NULL REFERENCES stage (id),
  track INTEGER NOT NULL,
  mode INTEGER,
  seen INTEGER NOT NULL,
  frequency_hz DOUBLE PRECISION NOT NULL,
  frequency_std_hz DOUBLE PRECISION NOT NULL,
  damping_ratio DOUBLE PRECISION NOT NULL,
  deviation DOUBLE PRECISION,
  shape BLOB,
  PRIMARY KEY (stage_id, track)
) WITHOUT ROWID;
CREATE TABLE log_file (
  path TEXT NOT NULL PRIMARY KEY,
  size INTEGER NOT NULL,
  changed_ns INTEGER NOT NULL,
  fingerprint TEXT NOT NULL
);
CREATE VIEW identifications AS
  SELECT s.name AS stage, i.time_utc, i.verdict, i.reasons, i.outlier, i.relative_rms_error, i.log, i.results
  FROM identification i JOIN stage s ON s.id = i.stage_id WHERE i.is_current = 1;
CREATE VIEW modes AS
  SELECT s.name AS stage, i.time_utc, t.mode, m.frequency_hz, m.frequency_std_hz, m.damping_ratio,
    m.damping_ratio_std, m.modal_mass, m.deviation
  FROM identification i JOIN stage s ON s.id = i.stage_id JOIN mode m ON m.identification_id = i.id
    LEFT JOIN track t ON t.stage_id = i.stage_id AND t.track = m.track
  WHERE i.is_current = 1;
CREATE VIEW outliers AS
  SELECT s.name AS stage, i.time_utc, i.verdict, i.outlier, i.reasons, i.log, i.results
  FROM identification i JOIN stage s ON s.id = i.stage_id
  WHERE i.is_current = 1 AND (i.verdict <> 'trustworthy' OR i.outlier IS NOT NULL);
CREATE VIEW stages AS
  SELECT s.name AS stage, COUNT(*) AS identifications,
    SUM(CASE WHEN i.verdict = 'not trustworthy' THEN 1 ELSE 0 END) AS not_trustworthy,
    SUM(CASE WHEN i.verdict = 'failed' THEN 1 ELSE 0 END) AS failed,
    SUM(CASE WHEN i.outlier IS NULL THEN 0 ELSE 1 END) AS outliers,
    MIN(i.time_utc) AS first_utc, MAX(i.time_utc) AS last_utc
  FROM stage s JOIN identification i ON i.stage_id = s.id WHERE i.is_current = 1 GROUP BY s.id, s.name;
CREATE VIEW stage_modes AS
  SELECT s.name AS stage, t.mode, t.seen, t.frequency_hz, t.frequency_std_hz, t.damping_ratio, t.deviation
  FROM track t JOIN stage s ON s.id = t.stage_id;

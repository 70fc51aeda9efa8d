// The numbers of tools/fleet/fleet_page.cpp, decoded per stage when it is shown.

decoders.u8 = (bytes) => bytes;
decoders.i16 = (bytes) => Int16Array.from(new Uint16Array(interleaved(bytes, 2)), signFirst);

// Names the values of each track, and finds where its series begin: in `present` one per identification of the stage, in the others one per value.
function placeTracks() {
  let present = 0, value = 0;
  for (const stage of content.stages) {
    stage.tracks = stage.tracks.map((values) => Object.fromEntries(content.track_keys.map((key, i) => [key, values[i]])));
    for (const track of stage.tracks) {
      Object.assign(track, { present, value });
      present += stage.count;
      value += track.seen;
    }
  }
}

// [frequency, standard deviation] per identification of the stage; null: not seen.
function valuesOf(stage, track) {
  const present = array('present'), change = array('change'), code = array('std');
  let at = track.value, sum = 0;
  return Array.from({ length: stage.count }, (_, i) => {
    if (!present[track.present + i]) return null;
    sum += change[at];
    const deviation = code[at] ? track.step * Math.pow(2, (code[at] - 128) / 8) : 0;
    ++at;
    return [track.least + sum * track.step, deviation];
  });
}

function timeOf(identification) {
  return new Date(60000 * array('minutes')[identification]);
}

function dateText(identification) {
  return timeOf(identification).toISOString().slice(0, 16).replace('T', ' ');
}

const hexOf = (byte) => byte.toString(16).padStart(2, '0');

// The address of the report of an identification; null: it failed.
function reportOf(identification) {
  const folder = content.folders[array('folder')[identification]];
  if (folder === undefined) return null;
  const job = Array.from(array('job').subarray(6 * identification, 6 * identification + 6), hexOf).join('');
  // './': a folder is not a scheme, whatever the store contains.
  return './' + folder.split('/').map(encodeURIComponent).join('/') + '/' + job.slice(0, 2) + '/' + job + '/report.html';
}

function stageOf(identification) {
  return content.stages.find((stage) => identification < stage.first + stage.count);
}

// The date as a link to the report of that day.
function reportLink(identification) {
  const address = reportOf(identification);
  return address ? element('a', { href: address }, dateText(identification)) : dateText(identification);
}

function modeName(track) {
  return 'mode ' + track.mode + ', ' + hertz(track.frequency_hz);
}

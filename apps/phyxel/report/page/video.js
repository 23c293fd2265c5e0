// A video of the replay, recorded by the browser.
const videoButton = document.getElementById('video'), videoType = ['video/mp4', 'video/webm'].find(type => window.MediaRecorder?.isTypeSupported(type));

/// Copies the stage, with its clock and its bar of colours, to a canvas.
function copyStage(to) {
  const pen = to.getContext('2d'), [width, height] = [to.width, to.height], size = width / stage.clientWidth;
  const ground = pen.createLinearGradient(0, 0, 0, height);
  ground.addColorStop(0, '#eef2f7'); ground.addColorStop(1, '#cfd8e3');
  pen.fillStyle = ground;
  pen.fillRect(0, 0, width, height);
  pen.drawImage(canvas, 0, 0, width, height);
  const box = stage.getBoundingClientRect(), write = (element, align = 'left') => {
    const at = element.getBoundingClientRect(), x = align === 'center' ? (at.left + at.right) / 2 : at.left + parseFloat(getComputedStyle(element).paddingLeft);
    pen.fillStyle = '#1c2330'; pen.textAlign = align; pen.textBaseline = 'bottom';
    pen.font = `${parseFloat(getComputedStyle(element).fontSize) * size}px system-ui, sans-serif`;
    pen.fillText(element.textContent, (x - box.left) * size, (at.bottom - box.top) * size);
  };
  write(stage.querySelector('.clock'));
  const axes = axesCanvas.getBoundingClientRect();
  pen.drawImage(axesCanvas, (axes.left - box.left) * size, (axes.top - box.top) * size, axes.width * size, axes.height * size);
  const legend = stage.querySelector('.legend');
  if (legend.hidden) return;
  const bar = legend.querySelector('canvas'), at = bar.getBoundingClientRect();
  pen.drawImage(bar, (at.left - box.left) * size, (at.top - box.top) * size, at.width * size, at.height * size);
  write(legend.querySelector('.name'));
  for (const tick of legend.querySelectorAll('.ticks span')) write(tick, 'center');
}

// How far the camera turns about the upward direction during a video [degrees], as by `phyxel render --orbit`.
const orbit = document.getElementById('orbit');
orbit.value = Number(asked.get('orbit') ?? data.view.orbit);

/// A function that turns the view to a share of the orbit, from so far that all of it holds what the present view would.
function orbiting() {
  const start = {...view}, degrees = Number(orbit.value) || 0, aspect = canvas.width / canvas.height, far = firstDistance(aspect);
  const turnedTo = share => ({...data.view, yaw: data.view.yaw + share * degrees * Math.PI / 180});
  let farther = 1;
  for (let k = 0; degrees && !data.view.distance && k <= 48; ++k) {
    const rows = matrix(turnedTo(k / 48));
    farther = Math.max(farther, distanceToSee(data.outermost.map(p => turnedBy(rows, p.map((v, axis) => v - data.view.pivot[axis]))), aspect) / far);
  }
  return share => Object.assign(view, start, {yaw: start.yaw + share * degrees * Math.PI / 180, distance: start.distance * farther});
}

/// Records all frames at the chosen speed. Returns the video.
async function recorded() {
  const rate = 30, length = frames[steps - 1] - frames[0], pictures = Math.max(2, Math.round(rate * length / Number(speed.value)));
  const film = element('canvas', {width: canvas.width & ~1, height: canvas.height & ~1}), pieces = [];
  copyStage(film);
  const recorder = new MediaRecorder(film.captureStream(rate), {mimeType: videoType, videoBitsPerSecond: 8e6});
  recorder.addEventListener('dataavailable', event => pieces.push(event.data));
  const ended = new Promise(done => recorder.addEventListener('stop', done));
  recorder.start();
  const start = performance.now(), turnTo = orbiting();
  for (let k = 0; k < pictures; ++k) {
    turnTo(k / (pictures - 1));
    show(nearest(frames[0] + k / (pictures - 1) * length));
    copyStage(film);
    await new Promise(done => setTimeout(done, Math.max(0, start + 1000 * (k + 1) / rate - performance.now())));
  }
  recorder.stop();
  await ended;
  return new Blob(pieces, {type: videoType});
}

async function saveVideo() {
  pause();
  const before = shown.frame, seenFrom = {...view};
  videoButton.disabled = true;
  videoButton.textContent = 'Recording …';
  const film = await recorded(), link = element('a', {href: URL.createObjectURL(film), download: `replay.${videoType.slice(6)}`});
  document.body.dataset.video = film.size;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  videoButton.textContent = 'Save video';
  videoButton.disabled = false;
  Object.assign(view, seenFrom);
  show(before);
}

document.getElementById('with-orbit').hidden = videoButton.hidden = !gl || !videoType || steps < 2;
videoButton.addEventListener('click', saveVideo);
if (!videoButton.hidden && asked.has('video')) saveVideo();

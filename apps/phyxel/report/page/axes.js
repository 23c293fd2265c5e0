// The directions of x, y and z in a corner of the stage.
const axesCanvas = document.querySelector('.stage .axes canvas');

/// Draws the axes of coordinates as the view sees them; those that point away come first.
/// rows: right, up and backwards of the view
function drawAxes(rows) {
  const ratio = Math.min(2, window.devicePixelRatio || 1), size = Math.round(72 * ratio);
  if (axesCanvas.width !== size) axesCanvas.width = axesCanvas.height = size;
  const pen = axesCanvas.getContext('2d'), length = 0.3 * size, middle = size / 2;
  pen.clearRect(0, 0, size, size);
  pen.font = `${13 * ratio}px system-ui, sans-serif`;
  pen.textAlign = 'center'; pen.textBaseline = 'middle'; pen.lineCap = 'round'; pen.lineWidth = 2 * ratio;
  const axes = ['x', 'y', 'z'].map((name, k) => ({name, ink: ['#ac3e3a', '#3e743a', '#3458a8'][k], right: rows[0][k], up: rows[1][k], near: rows[2][k]}));
  for (const {name, ink, right, up} of axes.sort((a, b) => a.near - b.near)) {
    const seen = Math.hypot(right, up), [x, y] = [middle + length * right, middle - length * up];
    // The name of an axis that points at the viewer, or away, stands beside the origin.
    const way = seen > 0.1 ? [right / seen, up / seen] : [0.7, -0.7];
    pen.strokeStyle = ink;
    pen.beginPath(); pen.moveTo(middle, middle); pen.lineTo(x, y); pen.stroke();
    pen.fillStyle = '#1c2330';
    pen.fillText(name, x + 8 * ratio * way[0], y - 8 * ratio * way[1]);
  }
}

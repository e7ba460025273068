// Drawings of the body: its outline, the reference body, the downhill step and the force.
function path(points) {
  return points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(4)} ${(-y).toFixed(4)}`).join("") + "Z";
}

function drawBody(body, [{ gradient }], valid) {
  const steepness = Math.hypot(...gradient.map((g, k) => g * model.width[k]));
  const stride = Math.min(0.12, 0.8 * steepness) / (steepness || 1);
  const downhill = model.within(body.map((x, k) => x - stride * gradient[k] * model.width[k] ** 2));
  const drawn = (parameters) => silhouette(parameters).map(path).join("");
  element("reference").setAttribute("d", drawn(model.reference));
  element("shape").setAttribute("d", drawn(body));
  element("rings").setAttribute("d", model.dimension === 3 ? rings(body) : "");
  const shown = valid && model.valid(downhill);
  element("downhill").setAttribute("d", shown ? drawn(downhill) : "");
}

// The force as an arrow from the centroid, and its two parts, drag to the right and lift upwards.
const FORCE = 1.0; // length in D of the reference body's drag, less where the frame is too small
function drawForce([drag, lift], reference, valid) {
  const { y: top, width, x: left } = element("shape").ownerSVGElement.viewBox.baseVal;
  const room = [(0.92 * (left + width)) / drag.value, (-0.92 * top) / Math.abs(lift.value)];
  const scale = Math.min(FORCE / reference, ...room);
  const upward = model.dimension === 3 ? Math.cos(PITCH) : 1; // as much as the body's height
  const [x, y] = [scale * drag.value, scale * upward * lift.value];
  element("force").setAttribute("d", valid ? arrow(x, y) : "");
  element("parts").setAttribute("d", valid ? `M0 0H${x.toFixed(4)}V${(-y).toFixed(4)}` : "");
}

function arrow(x, y) {
  const head = Math.min(0.14 / Math.hypot(x, y), 0.4);
  const barb = (side) => [x - head * (x + side * 0.45 * y), y - head * (y - side * 0.45 * x)];
  const [tip, ...barbs] = [[x, y], barb(1), barb(-1)].map(([u, v]) => `${u.toFixed(4)} ${(-v).toFixed(4)}`);
  return `M0 0L${tip}M${barbs[0]}L${tip}L${barbs[1]}`;
}

// 3-D bodies are seen from the side, slightly from above, so that the stream is level.
const PITCH = 0.35;
const [RIGHT, UP, AWAY] = [
  [1, 0, 0],
  [0, Math.sin(PITCH), Math.cos(PITCH)],
  [0, -Math.cos(PITCH), Math.sin(PITCH)],
];
const along = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const seen = (point) => [along(point, RIGHT), along(point, UP)];
const steps = (count, range) => Array.from({ length: count + 1 }, (_, n) => (range * n) / count);

// The outlines of a body as drawn. 3-D: the silhouette, where normals are perpendicular to the view;
// every ring has two such points or, near ends that are wholly visible or hidden, none.
function silhouette(parameters) {
  if (model.dimension === 2) return [model.contour(parameters, 240)];
  const at = model.skin(parameters);
  const facing = (t, phi) => along(at(t, phi).normal, AWAY);
  const turning = (t) => {
    const [front, side, back] = [0, Math.PI / 2, Math.PI].map((phi) => facing(t, phi));
    const level = (front + back) / 2;
    const [a, b] = [(front - back) / 2, side - level];
    const share = -level / Math.hypot(a, b);
    if (!(Math.abs(share) <= 1)) return null;
    return [1, -1].map((sign) => seen(at(t, Math.atan2(b, a) + sign * Math.acos(share)).point));
  };
  const outlines = [];
  let [before, pair] = [0, null];
  for (const t of steps(200, Math.PI).slice(1)) {
    const found = turning(t);
    if (found && !pair) outlines.push([]);
    if (!found !== !pair) outlines.at(-1).push(lastOf(turning, ...(found ? [t, before] : [before, t])));
    if (found) outlines.at(-1).push(found);
    [before, pair] = [t, found];
  }
  return outlines.map((pairs) => [...pairs.map((p) => p[0]), ...pairs.map((p) => p[1]).reverse()]);
}

// Bisect between an argument where `find` has a value and one where it has none; the last value.
function lastOf(find, some, none) {
  for (let n = 0; n < 40; n++) {
    const middle = (some + none) / 2;
    if (find(middle)) some = middle;
    else none = middle;
  }
  return find(some);
}

// Rings and meridians on the visible side of a body.
function rings(parameters) {
  const at = model.skin(parameters);
  const across = steps(14, Math.PI).map((t) => steps(96, 2 * Math.PI).map((phi) => [t, phi]));
  const lengthways = steps(12, 2 * Math.PI).map((phi) => steps(64, Math.PI).map((t) => [t, phi]));
  return [...across, ...lengthways].map((line) => visible(line, at)).join("");
}

function visible(line, at) {
  let [text, pen] = ["", "M"];
  for (const [t, phi] of line) {
    const { point, normal } = at(t, phi);
    const [x, y] = seen(point);
    const front = along(normal, AWAY) > 0;
    if (front) text += `${pen}${x.toFixed(3)} ${(-y).toFixed(3)}`;
    pen = front ? "L" : "M";
  }
  return text;
}

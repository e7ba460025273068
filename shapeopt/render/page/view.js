// The page: reads the sliders, evaluates the model, updates drawings and numbers.
const data = JSON.parse(document.getElementById("data").textContent);
const model = makeModel(data);
const element = (id) => document.getElementById(id);
const sliders = data.names.map(element);
const signed = (value, digits) => (value < 0 ? "\u2212" : "+") + Math.abs(value).toFixed(digits);
const significant = (value) => value.toPrecision(4);
const minus = (text) => text.replace("-", "\u2212");
const parameters = () => sliders.map((slider) => Number(slider.value));
const reynolds = () => Math.exp(Number(element("reynolds").value));

function path(points) {
  return points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(4)} ${(-y).toFixed(4)}`).join("") + "Z";
}

function update() {
  const [body, re] = [parameters(), reynolds()];
  const valid = model.valid(body);
  const found = model.drag(body, re);
  const reference = model.drag(model.reference, re).cd;
  tell(element("reynolds"), String(Number(re.toPrecision(3))));
  sliders.forEach((slider, k) => {
    tell(slider, minus(body[k].toFixed(3)));
    element(`${slider.id}-way`).textContent = valid ? way(found, k, body[k]) : "";
  });
  document.body.classList.toggle("crossed", !valid);
  element("cd").textContent = valid ? significant(found.cd) : "\u2013";
  element("reference-cd").textContent = significant(reference);
  element("difference").textContent = valid ? `${signed(100 * (found.cd / reference - 1), 1)} %` : "\u2013";
  element("warning").hidden = valid;
  element("download").disabled = !valid;
  drawBody(body, found, valid);
  drawCurve(body, re, valid);
}

// Set a slider's value as text, for screen readers too: Re, not its logarithm.
function tell(slider, text) {
  element(`${slider.id}-value`).textContent = text;
  slider.setAttribute("aria-valuetext", text);
}

// The direction of a slider that lowers drag, and the change for a tenth of its range (first order).
function way({ cd, gradient }, k, value) {
  const change = (10 * gradient[k] * model.width[k]) / cd;
  if (Math.abs(change) < 0.005) return "level";
  const end = model.bounds[k][change < 0 ? 1 : 0];
  if (Math.abs(value - end) < 1e-6 * model.width[k]) return "at its end";
  return `${change < 0 ? "\u25b6" : "\u25c0"} ${signed(-Math.abs(change), 2)} %`;
}

function drawBody(body, { cd, gradient }, valid) {
  const steepness = Math.hypot(...gradient.map((g, k) => (g * model.width[k]) / cd));
  const stride = Math.min(0.12, 0.8 * steepness) / (steepness || 1);
  const downhill = model.within(body.map((x, k) => x - (stride * gradient[k] * model.width[k] ** 2) / cd));
  const drawn = (parameters) => silhouette(parameters).map(path).join("");
  element("reference").setAttribute("d", drawn(model.reference));
  element("shape").setAttribute("d", drawn(body));
  element("rings").setAttribute("d", model.dimension === 3 ? rings(body) : "");
  const shown = valid && model.valid(downhill);
  element("downhill").setAttribute("d", shown ? drawn(downhill) : "");
}

// 3-D bodies are seen from the side, slightly from ahead and above.
const [YAW, PITCH] = [0.45, 0.35];
const [RIGHT, UP, AWAY] = [
  [Math.cos(YAW), -Math.sin(YAW), 0],
  [Math.sin(YAW) * Math.sin(PITCH), Math.cos(YAW) * Math.sin(PITCH), Math.cos(PITCH)],
  [-Math.sin(YAW) * Math.cos(PITCH), -Math.cos(YAW) * Math.cos(PITCH), Math.sin(PITCH)],
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

// Tick values: round numbers of a logarithmic axis, at most `room`; evenly spaced on a short axis.
function ticks(least, most, room) {
  const inside = (value) => value >= least * (1 - 1e-9) && value <= most * (1 + 1e-9);
  const rounds = (marks) => [...Array(10).keys()].flatMap((e) => marks.map((m) => m * 10 ** (e - 4)));
  for (const marks of [[1, 2, 5], [1]]) {
    const found = rounds(marks).filter(inside);
    if (found.length > 2 && found.length <= room) return found;
  }
  const step = rounds([1, 2, 5]).find((value) => most - least <= value * Math.min(room, 6));
  return Array.from({ length: 7 }, (_, n) => (Math.ceil(least / step - 1e-9) + n) * step).filter(inside);
}

function drawCurve(body, re, valid) {
  const [low, high] = model.reynolds.map(Math.log);
  element("curve").parentElement.hidden = low === high;
  if (low === high) return;
  const across = element("curve").clientWidth || 600;
  const [left, right, top, bottom] = [44, across - 14, 8, 188];
  const values = Array.from({ length: 81 }, (_, k) => Math.exp(low + ((high - low) * k) / 80));
  const curves = [model.reference, body].map((p) => values.map((value) => model.drag(p, value).cd));
  const shown = (valid ? curves.flat() : curves[0]).map(Math.log10);
  const [least, most] = [Math.min(...shown) - 0.05, Math.max(...shown) + 0.05];
  const x = (value) => left + ((right - left) * (Math.log(value) - low)) / (high - low);
  const y = (value) => bottom - ((bottom - top) * (Math.log10(value) - least)) / (most - least);
  const line = (drags) => "M" + drags.map((d, k) => `${x(values[k]).toFixed(1)} ${y(d).toFixed(1)}`).join("L");
  const text = (value) => Number(value.toPrecision(3));
  const vertical = ticks(...model.reynolds, across / 45).map(
    (tick) => `<path class="grid" d="M${x(tick)} ${top}V${bottom}"/>
      <text x="${x(tick)}" y="${bottom + 18}" text-anchor="middle">${text(tick)}</text>`,
  );
  const horizontal = ticks(10 ** least, 10 ** most, 9).map(
    (tick) => `<path class="grid" d="M${left} ${y(tick)}H${right}"/>
      <text x="${left - 8}" y="${y(tick) + 4}" text-anchor="end">${text(tick)}</text>`,
  );
  const own = valid
    ? `<path class="own" d="${line(curves[1])}"/>
      <circle r="6" cx="${x(re)}" cy="${y(model.drag(body, re).cd)}"/>`
    : "";
  element("curve").setAttribute("viewBox", `0 0 ${across} 216`);
  element("curve").innerHTML = `${vertical.join("")}${horizontal.join("")}
    <path class="here" d="M${x(re)} ${top}V${bottom}"/>
    <path class="other" d="${line(curves[0])}"/>${own}`;
}

// Animate the sliders to a body; at once where the user prefers reduced motion.
let glide = 0;
function moveTo(target) {
  const [start, mine] = [parameters(), ++glide];
  const frames = matchMedia("(prefers-reduced-motion: reduce)").matches ? 1 : 24;
  function frame(n) {
    if (mine !== glide) return;
    const s = n / frames;
    const eased = s * s * (3 - 2 * s);
    sliders.forEach((slider, k) => (slider.value = start[k] + eased * (target[k] - start[k])));
    update();
    if (n < frames) requestAnimationFrame(() => frame(n + 1));
  }
  frame(1);
}

function download() {
  const rows = model.contour(parameters(), 400).map(([x, y]) => `${x.toFixed(9)},${y.toFixed(9)}`);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob(["x,y\n", rows.join("\n"), "\n"], { type: "text/csv" }));
  link.download = "contour.csv";
  link.click();
  URL.revokeObjectURL(link.href);
}

// Arrow keys move 1/100 of the range, page keys 1/10; browsers differ for step "any".
const STRIDES = { Arrow: 0.01, Page: 0.1, Home: Infinity, End: Infinity };
function press(event) {
  const [, key, way] = event.key.match(/^(Arrow|Page|Home|End)(Up|Right|Down|Left|)$/) || [];
  if (!key || event.altKey || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  const { target: slider } = event;
  const back = key === "Home" || way === "Down" || way === "Left";
  const [low, high] = [Number(slider.min), Number(slider.max)];
  const moved = Number(slider.value) + (back ? -1 : 1) * STRIDES[key] * (high - low);
  slider.value = Math.min(Math.max(moved, low), high);
  slider.dispatchEvent(new Event("input"));
}

[...sliders, element("reynolds")].forEach((slider) => {
  slider.addEventListener("keydown", press);
  slider.addEventListener("input", () => {
    glide++;
    update();
  });
});
element("least").addEventListener("click", () => moveTo(model.leastDrag(parameters(), reynolds()).parameters));
element("round").addEventListener("click", () => moveTo(model.reference));
element("download").addEventListener("click", download);
addEventListener("resize", update);
update();

// The page: sliders in, drawings and numbers out. Everything it computes comes from the model.
const data = JSON.parse(document.getElementById("data").textContent);
const model = makeModel(data);
const element = (id) => document.getElementById(id);
const sliders = data.names.map(element);
const signed = (value, digits) => (value < 0 ? "\u2212" : "+") + Math.abs(value).toFixed(digits);
const significant = (value) => value.toPrecision(4);
const parameters = () => sliders.map((slider) => Number(slider.value));
const reynolds = () => Math.exp(Number(element("reynolds").value));

function path(points) {
  return points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(4)} ${(-y).toFixed(4)}`).join("") + "Z";
}

function update() {
  const [body, re] = [parameters(), reynolds()];
  const valid = model.valid(body);
  const found = model.drag(body, re);
  const reference = model.drag(model.cylinder, re).cd;
  element("reynolds-value").textContent = re.toPrecision(3);
  sliders.forEach((slider, k) => {
    element(`${slider.id}-value`).textContent = body[k].toFixed(3).replace("-", "\u2212");
    element(`${slider.id}-way`).textContent = valid ? way(found, k, body[k]) : "";
  });
  document.body.classList.toggle("crossed", !valid);
  element("cd").textContent = valid ? significant(found.cd) : "\u2013";
  element("reference").textContent = significant(reference);
  element("difference").textContent = valid ? `${signed(100 * (found.cd / reference - 1), 1)} %` : "\u2013";
  element("warning").hidden = valid;
  element("download").disabled = !valid;
  drawBody(body, found, valid);
  drawCurve(body, re, valid);
}

// Which way to move a slider, and what a tenth of its range would bring to first order.
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
  element("cylinder").setAttribute("d", path(model.contour(model.cylinder, 120)));
  element("shape").setAttribute("d", path(model.contour(body, 240)));
  const shown = valid && model.valid(downhill);
  element("downhill").setAttribute("d", shown ? path(model.contour(downhill, 240)) : "");
}

function drawCurve(body, re, valid) {
  const [low, high] = model.reynolds.map(Math.log);
  const across = element("curve").clientWidth || 600;
  const [left, right, top, bottom] = [34, across - 10, 8, 188];
  const values = Array.from({ length: 81 }, (_, k) => Math.exp(low + ((high - low) * k) / 80));
  const curves = [model.cylinder, body].map((p) => values.map((value) => model.drag(p, value).cd));
  const shown = (valid ? curves.flat() : curves[0]).map(Math.log10);
  const [least, most] = [Math.min(...shown) - 0.05, Math.max(...shown) + 0.05];
  const x = (value) => left + ((right - left) * (Math.log(value) - low)) / (high - low);
  const y = (value) => bottom - ((bottom - top) * (Math.log10(value) - least)) / (most - least);
  const line = (drags) => "M" + drags.map((d, k) => `${x(values[k]).toFixed(1)} ${y(d).toFixed(1)}`).join("L");
  const ticks = [1, 2, 5].flatMap((m) => [-4, -3, -2, -1, 0, 1, 2, 3].map((e) => m * 10 ** e));
  const inside = (value, a, b) => value >= a * (1 - 1e-9) && value <= b * (1 + 1e-9);
  const text = (value) => Number(value.toPrecision(1));
  const vertical = ticks
    .filter((tick) => inside(tick, ...model.reynolds))
    .map(
      (tick) => `<path class="grid" d="M${x(tick)} ${top}V${bottom}"/>
        <text x="${x(tick)}" y="${bottom + 18}" text-anchor="middle">${text(tick)}</text>`,
    );
  const horizontal = ticks
    .filter((tick) => inside(tick, 10 ** least, 10 ** most))
    .map(
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

// Glide to a body, or be there at once for those who prefer it.
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

[...sliders, element("reynolds")].forEach((slider) =>
  slider.addEventListener("input", () => {
    glide++;
    update();
  }),
);
element("least").addEventListener("click", () => moveTo(model.leastDrag(parameters(), reynolds()).parameters));
element("round").addEventListener("click", () => moveTo(model.cylinder));
element("download").addEventListener("click", download);
addEventListener("resize", update);
update();

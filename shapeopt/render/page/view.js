// The page: reads the sliders, evaluates the model, updates drawings and numbers.
const data = JSON.parse(document.getElementById("data").textContent);
const model = makeModel(data);
const element = (id) => document.getElementById(id);
const sliders = data.names.map(element);
const signed = (value, digits) => (value < 0 ? "\u2212" : "+") + Math.abs(value).toFixed(digits);
const significant = (value) => value.toPrecision(4);
const minus = (text) => text.replace("-", "\u2212");
const fixed = (value, digits) => minus((Number(value.toFixed(digits)) || 0).toFixed(digits)); // no -0
const parameters = () => sliders.map((slider) => Number(slider.value));
const reynolds = () => Math.exp(Number(element("reynolds").value));

function update() {
  const [body, re] = [parameters(), reynolds()];
  const valid = model.valid(body);
  const [found, loads] = [model.outputs(body, re), model.loads(body, re)];
  const [{ value: cd }] = loads;
  const [{ value: reference }] = model.loads(model.reference, re);
  tell(element("reynolds"), String(Number(re.toPrecision(4))));
  sliders.forEach((slider, k) => {
    tell(slider, slider.id === "incidence" ? `${fixed(body[k], 2)}\u00b0` : minus(body[k].toFixed(3)));
    element(`${slider.id}-way`).textContent = valid ? way(found[0], k, body[k]) : "";
  });
  document.body.classList.toggle("crossed", !valid);
  element("cd").textContent = valid ? significant(cd) : "\u2013";
  element("reference-cd").textContent = significant(reference);
  element("difference").textContent = valid ? `${signed(100 * (cd / reference - 1), 1)} %` : "\u2013";
  element("download").disabled = !valid;
  drawBody(body, found, valid);
  drawCurve(body, re, valid);
  if (model.lifting) showLift(body, re, loads, valid);
}

// Of bodies with lift: Cl, Cm and the glide ratio, the arrow of the force, and the curves.
function showLift(body, re, loads, valid) {
  const [drag, lift, moment] = loads.map(({ value }) => value);
  const numbers = { cl: lift, cm: moment, ratio: lift / drag };
  // Errors of Cl and Cm are of the size of Cd's: no more decimals than its four digits have.
  const decimals = Math.min(Math.max(3 - Math.floor(Math.log10(drag)), 0), 4);
  for (const [id, value] of Object.entries(numbers)) {
    element(id).textContent = valid ? fixed(value, id === "ratio" ? 3 : decimals) : "\u2013";
  }
  element("by-chord").textContent = valid ? byChord(body, re, numbers, drag) : "";
  drawForce(loads, model.loads(model.reference, re)[0].value, valid);
  drawLift(body, re, valid);
}

// Reynolds number and coefficients of a section by its chord c: Cd / c, Cl / c, Cm / c^2.
function byChord(body, re, { cl, cm }, cd) {
  const c = model.chord(body);
  const [drag, lift, moment] = [significant(cd / c), fixed(cl / c, 3), fixed(cm / c ** 2, 3)];
  return `Over the chord c = ${c.toFixed(3)} D: chord Re ${significant(re * c)}, Cd ${drag}, Cl ${lift}, Cm ${moment} (c\u00b2, about the centroid)`;
}

// Show a slider's value in its field and to screen readers: Re, not its logarithm.
function tell(slider, text) {
  const field = element(`${slider.id}-value`);
  if (field !== document.activeElement) field.value = text;
  slider.setAttribute("aria-valuetext", text);
}

// Set a slider to a number that was typed, or to the nearer end; what is no number is put back.
function type(slider) {
  const field = element(`${slider.id}-value`);
  const text = field.value.replace("\u2212", "-").replace(",", ".").replace("\u00b0", "").trim();
  const number = slider.id === "reynolds" ? Math.log(Number(text)) : Number(text);
  moveSlider(slider, text && !Number.isNaN(number) ? number : Number(slider.value));
}

// Set a slider to a value, or to the nearer end, as if it were dragged there.
function moveSlider(slider, value) {
  slider.value = Math.min(Math.max(value, Number(slider.min)), Number(slider.max));
  slider.dispatchEvent(new Event("input"));
}

// The direction of a slider that lowers drag, and the change for a tenth of its range (first order).
function way({ gradient }, k, value) {
  const change = 10 * gradient[k] * model.width[k];
  if (Math.abs(change) < 0.005) return "level";
  const end = model.bounds[k][change < 0 ? 1 : 0];
  if (Math.abs(value - end) < 1e-6 * model.width[k]) return "at its end";
  return `${change < 0 ? "\u25b6" : "\u25c0"} ${signed(-Math.abs(change), 2)} %`;
}

// Animate the sliders to a body; at once where the user prefers reduced motion.
let moves = 0;
function moveTo(target) {
  const [start, mine] = [parameters(), ++moves];
  const frames = matchMedia("(prefers-reduced-motion: reduce)").matches ? 1 : 24;
  function frame(n) {
    if (mine !== moves) return;
    const s = n / frames;
    const eased = s * s * (3 - 2 * s);
    sliders.forEach((slider, k) => (slider.value = start[k] + eased * (target[k] - start[k])));
    update();
    if (n < frames) requestAnimationFrame(() => frame(n + 1));
  }
  frame(1);
}

function download() {
  const rows = model.outline(parameters(), 400).map(([x, y]) => `${x.toFixed(9)},${y.toFixed(9)}`);
  const named = data.names.map((name, k) => `${name} ${parameters()[k].toPrecision(9)}`);
  if (data.names.includes("incidence")) named.push("the points are at incidence 0");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([`# ${named.join(", ")}\n`, "x,y\n", rows.join("\n"), "\n"], { type: "text/csv" }));
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
  moveSlider(slider, Number(slider.value) + (back ? -1 : 1) * STRIDES[key] * (high - low));
}

[...sliders, element("reynolds")].forEach((slider) => {
  const field = element(`${slider.id}-value`);
  field.addEventListener("change", () => {
    field.blur(); // so that the value is shown as it was read
    type(slider);
  });
  slider.addEventListener("keydown", press);
  slider.addEventListener("input", () => {
    moves++;
    update();
  });
});
element("by-chord").hidden = model.dimension === 3;
const moveToBest = (goal) => moveTo(model.best(goal, parameters(), reynolds()).parameters);
element("least").addEventListener("click", () => moveToBest("drag"));
element("glide").addEventListener("click", () => moveToBest("glide"));
element("round").addEventListener("click", () => moveTo(model.reference));
element("download").addEventListener("click", download);
addEventListener("resize", update);
update();

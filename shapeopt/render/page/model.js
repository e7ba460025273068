// The model: network and family of bodies, and the search for the best body.
function makeModel(data) {
  const [network, family] = [makeNetwork(data), makeFamily(data)];
  const { bounds, width, nearest, clear, reference, names } = family;
  const { outputs } = network;

  // What is minimised, with its gradient: log Cd, or the glide ratio Cl / Cd with its sign changed.
  const goals = {
    drag: (parameters, re) => outputs(parameters, re)[0],
    glide: (parameters, re) => {
      const { value, gradient } = outputs(parameters, re)[1];
      return { value: -value, gradient: gradient.map((slope) => -slope) };
    },
  };

  // Projected gradient descent in parameters scaled to [0, 1], with an adaptive step.
  function descend(goal, start, re, iterations = 600) {
    let here = start;
    let { value, gradient } = goal(here, re);
    let step = 0.1;
    for (let n = 0; n < iterations && step > 1e-10; n++) {
      const trial = nearest(here.map((x, k) => x - step * gradient[k] * width[k] ** 2));
      const found = goal(trial, re);
      if (found.value < value && clear(trial)) {
        [here, { value, gradient }, step] = [trial, found, step * 1.7];
      } else {
        step /= 2.3;
      }
    }
    return { parameters: here, value };
  }

  // Starts: ellipses of all aspects, and a low-discrepancy sequence over the family (Roberts 2018).
  function starts(ellipses = 25, spreadOut = 600) {
    const [least, most] = bounds[0];
    let golden = 2;
    for (let n = 0; n < 40; n++) golden = (1 + golden) ** (1 / (bounds.length + 1));
    return [
      ...Array.from({ length: ellipses }, (_, n) =>
        bounds.map((_, k) => (k ? reference[k] : least + ((most - least) * n) / (ellipses - 1))),
      ),
      ...Array.from({ length: spreadOut }, (_, n) =>
        bounds.map(([a], k) => a + width[k] * ((0.5 + (n + 1) / golden ** (k + 1)) % 1)),
      ),
    ];
  }

  // The best body by a goal: descent from the best of the starts and the given body.
  function best(name, current, re, kept = 5) {
    const goal = goals[name];
    return [current, ...starts()]
      .map(nearest)
      .filter(clear)
      .map((parameters) => ({ parameters, value: goal(parameters, re).value }))
      .sort((a, b) => a.value - b.value)
      .slice(0, kept)
      .map(({ parameters }) => descend(goal, parameters, re))
      .reduce((least, found) => (found.value < least.value ? found : least), {
        parameters: current,
        value: Infinity,
      });
  }

  // The body at another incidence.
  function turned(parameters, incidence) {
    return parameters.map((x, k) => (names[k] === "incidence" ? incidence : x));
  }

  // The incidence of best glide of one shape: the best of samples, then golden sections about it.
  function glideIncidence(parameters, re) {
    const [low, high] = bounds[names.indexOf("incidence")];
    const glide = (incidence) => outputs(turned(parameters, incidence), re, false)[1].value;
    const samples = Array.from({ length: 33 }, (_, n) => low + ((high - low) * n) / 32);
    const values = samples.map(glide);
    const place = values.indexOf(Math.max(...values));
    let [a, b] = [samples[Math.max(place - 1, 0)], samples[Math.min(place + 1, 32)]];
    const share = (Math.sqrt(5) - 1) / 2;
    for (let n = 0; n < 30; n++) {
      const [c, d] = [b - share * (b - a), a + share * (b - a)];
      if (glide(c) > glide(d)) b = d;
      else a = c;
    }
    return [(a + b) / 2, samples[place]].reduce((x, y) => (glide(y) > glide(x) ? y : x));
  }

  return { ...network, ...family, best, turned, glideIncidence, reynolds: data.reynolds };
}

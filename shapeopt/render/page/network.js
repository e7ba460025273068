// The network: log Cd, with lift also Cl / Cd and Cm / Cd, and their gradients in the parameters.
const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

function makeNetwork(data) {
  const { layers, trends, heads, reach, low, high, ratios, mirror } = data;
  const span = high.map((b, k) => b - low[k] || 1); // 1 where the scene has one Reynolds number
  const PARITY = [1, -1, -1]; // of the mirror image: equal drag, opposite lift and moment

  const affine = ({ weight, bias }, x) => weight.map((row, i) => dot(row, x) + bias[i]);

  // A quadratic trend of the scaled inputs z and its gradient; coefficients of 1, z, z_i z_j (j >= i).
  function quadratic(trend, z) {
    const count = z.length;
    let [value, place] = [trend[0], count + 1];
    const slopes = trend.slice(1, count + 1);
    z.forEach((x, i) => (value += trend[1 + i] * x));
    for (let i = 0; i < count; i++) {
      for (let j = i; j < count; j++, place++) {
        value += trend[place] * z[i] * z[j];
        slopes[i] += trend[place] * z[j];
        slopes[j] += trend[place] * z[i];
      }
    }
    return { value, slopes };
  }

  // Every layer's inputs, and the gradient of a weighted sum of the last ones, by backpropagation.
  function forward(z) {
    const trace = [z];
    for (const layer of layers.slice(0, -1)) trace.push(affine(layer, trace.at(-1)).map(Math.tanh));
    return trace;
  }

  function backward(trace, weights) {
    let back = weights;
    for (let k = layers.length - 2; k >= 0; k--) {
      const slope = trace[k + 1].map((y, i) => (1 - y * y) * back[i]);
      back = trace[k].map((_, j) => slope.reduce((sum, s, i) => sum + s * layers[k].weight[i][j], 0));
    }
    return back;
  }

  // The outputs at scaled inputs before they are made even or odd, and if asked for their gradients.
  function unsymmetric(z, sloped) {
    const [trace, last] = [forward(z), layers.at(-1)];
    return heads.map((head, k) => {
      const trend = quadratic(trends[k], z);
      const value = trend.value + reach * (dot(last.weight[head], trace.at(-1)) + last.bias[head]);
      if (!sloped) return { value, slopes: [] };
      const back = backward(trace, last.weight[head]);
      return { value, slopes: trend.slopes.map((slope, i) => slope + reach * back[i]) };
    });
  }

  // Log Cd is even and the others odd where a body changes to its mirror image.
  function symmetric(z, sloped) {
    const own = unsymmetric(z, sloped);
    if (heads.length === 1) return own;
    const image = unsymmetric(z.map((x, i) => mirror[i] * x), sloped);
    return own.map(({ value, slopes }, k) => ({
      value: (value + PARITY[k] * image[k].value) / 2,
      slopes: slopes.map((slope, i) => (slope + PARITY[k] * mirror[i] * image[k].slopes[i]) / 2),
    }));
  }

  // Log Cd (, Cl / Cd, Cm / Cd), each with its gradient in the shape parameters if asked for.
  function outputs(parameters, re, sloped = true) {
    const inputs = [...parameters.map((x, k) => (k < ratios ? Math.log(x) : x)), Math.log(re)];
    const chain = parameters.map((x, k) => (k < ratios ? 2 / x : 2) / span[k]);
    const z = inputs.map((x, k) => (2 * (x - low[k])) / span[k] - 1);
    return symmetric(z, sloped).map(({ value, slopes }) => ({
      value,
      gradient: slopes.slice(0, chain.length).map((slope, k) => slope * chain[k]),
    }));
  }

  // Cd (, Cl, Cm), each with its gradient in the shape parameters if asked for.
  function loads(parameters, re, sloped = true) {
    const [drag, ...others] = outputs(parameters, re, sloped);
    const cd = Math.exp(drag.value);
    return [
      { value: cd, gradient: drag.gradient.map((slope) => cd * slope) },
      ...others.map(({ value, gradient }) => ({
        value: cd * value,
        gradient: gradient.map((slope, k) => cd * (slope + value * drag.gradient[k])),
      })),
    ];
  }

  return { outputs, loads, lifting: heads.length > 1 };
}

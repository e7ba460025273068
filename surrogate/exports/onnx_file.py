"""A surrogate as an ONNX model: inputs -> loads, jacobian, status."""

import math
from typing import TYPE_CHECKING

import numpy as np

from surrogate.errors import InvalidInput
from surrogate.exports.literals import Precision
from surrogate.exports.plain import PlainNetwork

if TYPE_CHECKING:
    import onnx

OPSET, IR_VERSION = 18, 10  # understood by onnxruntime since 1.18


def onnx_model(
    plain: PlainNetwork, card: str, precision: Precision, name: str
) -> "onnx.ModelProto":
    """Return an ONNX model of inputs (n, inputs) with outputs loads, jacobian and status.

    Loads and jacobian are NaN where the status is 2.

    Args:
      plain: the numbers of the network.
      card: the model card, which becomes the model's documentation.
      precision: of all floating-point numbers.
      name: of the graph.

    Raises:
      InvalidInput: the package onnx is not installed.
    """
    try:
        from onnx import helper
    except ImportError:
        raise InvalidInput(
            "export to ONNX: needs the package onnx; pip install 'drag-surrogates[onnx]'"
        ) from None
    graph = _Graph(helper, precision)
    loads, jacobian, status = _outputs(graph, plain, precision)
    kind, count, outputs = graph.kind, len(plain.inputs), len(plain.loads)
    for source, result in ((loads, "loads"), (jacobian, "jacobian"), (status, "status")):
        graph.nodes.append(helper.make_node("Identity", [source], [result]))
    whole = helper.np_dtype_to_tensor_dtype(np.dtype("int64"))
    value = helper.make_tensor_value_info
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            name,
            [value("inputs", kind, ["n", count])],
            [
                value("loads", kind, ["n", outputs]),
                value("jacobian", kind, ["n", outputs, count]),
                value("status", whole, ["n"]),
            ],
            graph.constants,
            doc_string=card,
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="drag-surrogates",
        doc_string=card,
    )
    for key, names in (("inputs", plain.inputs), ("loads", plain.loads)):
        model.metadata_props.add(key=key, value=", ".join(names))
    return model


class _Graph:
    """Nodes and constants of a model under construction."""

    def __init__(self, helper, precision):
        self.helper, self.dtype = helper, precision.dtype
        self.kind = helper.np_dtype_to_tensor_dtype(np.dtype(precision.dtype))
        self.nodes, self.constants = [], []

    def constant(self, values, dtype=None):
        """Add a constant and return its name."""
        from onnx import numpy_helper

        name = f"c{len(self.constants)}"
        array = np.asarray(values, dtype or self.dtype)
        self.constants.append(numpy_helper.from_array(array, name))
        return name

    def __call__(self, operator, *inputs, **attributes):
        """Add a node, whose inputs are names or numbers, and return the name of its output."""
        names = [x if isinstance(x, str) else self.constant(x) for x in inputs]
        output = f"v{len(self.nodes)}"
        self.nodes.append(self.helper.make_node(operator, names, [output], **attributes))
        return output

    def axes(self, *axes):
        return self.constant(axes, "int64")


def _outputs(g, plain, precision):
    """Return the names of loads, jacobian and status."""
    logs, ones = g.constant(plain.logs, bool), np.ones(1)
    logarithms = g("Log", g("Where", logs, "inputs", ones))
    values = g("Where", logs, logarithms, "inputs")
    scaled = g("Add", g("Mul", values, plain.scale), plain.shift)
    z, chain = _features(g, plain, scaled)
    f, by = _evaluated(g, plain, z)
    if len(plain.loads) > 1:  # even (Cd) or odd (Cl, Cm) under the mirror image
        image, by_image = _evaluated(g, plain, g("Mul", z, plain.mirror))

        def half(own, other, factor):
            return g("Mul", g("Add", own, g("Mul", other, factor)), 0.5 * ones)

        f = [half(a, b, p * ones) for a, b, p in zip(f, image, plain.parity, strict=True)]
        by = [
            half(a, b, p * plain.mirror) for a, b, p in zip(by, by_image, plain.parity, strict=True)
        ]
    by, cd = [chain(one) for one in by], g("Exp", f[0])
    loads = [cd, *(g("Mul", cd, one) for one in f[1:])]
    own = zip(by[1:], f[1:], strict=True)
    slopes = [by[0], *(g("Add", slope, g("Mul", one, by[0])) for slope, one in own)]
    steps = g("Mul", g("Div", plain.scale, g("Where", logs, "inputs", ones)), cd)
    rows = [g("Unsqueeze", g("Mul", slope, steps), g.axes(1)) for slope in slopes]
    valid, status = _status(g, plain, precision, logarithms)
    nan = np.full(1, np.nan)
    loads = g("Where", valid, g("Concat", *loads, axis=1), nan)
    deep = g("Unsqueeze", valid, g.axes(2))
    return loads, g("Where", deep, g("Concat", *rows, axis=1), nan), status


def _features(g, plain, scaled):
    """Return the features, and a function from derivatives in them to those in scaled inputs."""
    if plain.incidence < 0:
        return scaled, lambda by: by
    of, inputs = plain.sources, np.arange(len(plain.inputs))
    is_incidence = g.constant(inputs == plain.incidence, bool)
    a = g("Mul", g("Gather", scaled, g.axes(plain.incidence), axis=1), np.full(1, plain.angle))
    twice, one = g("Mul", a, np.full(1, 2.0)), g("Mul", a, np.zeros(1))
    c, s, c2, s2 = (g(f, x) for x in (a, twice) for f in ("Cos", "Sin"))
    own = g("Gather", g("Where", is_incidence, np.ones(1), scaled), g.axes(*of), axis=1)
    waves = g("Concat", g("Exp", one), c, s, c2, s2, axis=1)
    slopes = g("Concat", one, s, c, s2, c2, axis=1)
    signs = plain.angle * np.array([0.0, -1, 1, -2, 2])
    waves, slopes = (
        g("Gather", x, g.axes(*plain.waves), axis=1) for x in (waves, g("Mul", slopes, signs))
    )
    chosen = (of[:, None] == inputs) & (inputs != plain.incidence)
    turned = np.tile(inputs == plain.incidence, (len(of), 1))

    def chain(by):
        others = g("MatMul", g("Mul", by, waves), chosen.astype(float))
        by_incidence = g("Mul", g("Mul", by, own), slopes)
        return g("Add", others, g("MatMul", by_incidence, turned.astype(float)))

    return g("Mul", own, waves), chain


def _evaluated(g, plain, z):
    """Return by load the outputs (n, 1), not yet even or odd, and their derivatives (n, inputs)."""
    trace = [z]
    for weight, bias in zip(plain.weights[:-1], plain.biases[:-1], strict=True):
        trace.append(g("Tanh", g("Add", g("MatMul", trace[-1], weight.T), bias)))
    outputs, derivatives = [], []
    for k in range(len(plain.constant)):
        product = g("MatMul", z, plain.quadratic[k])
        trend = g("Mul", g("Add", product, plain.linear[k]), z)
        trend = g("ReduceSum", trend, g.axes(1), keepdims=1)
        constant = plain.constant[k] + plain.biases[-1][k]
        row = plain.weights[-1][k : k + 1]
        outputs.append(g("Add", g("Add", trend, g("MatMul", trace[-1], row.T)), [constant]))
        back = row
        for weight, values in zip(plain.weights[-2::-1], trace[:0:-1], strict=True):
            slope = g("Sub", np.ones(1), g("Mul", values, values))
            back = g("MatMul", g("Mul", slope, back), weight)
        trend = g("Add", g("Mul", product, np.full(1, 2.0)), plain.linear[k])
        derivatives.append(g("Add", trend, back))
    if plain.inertial:
        return _with_moment(g, plain, z, outputs, derivatives)
    return outputs, derivatives


def _with_moment(g, plain, z, outputs, derivatives):
    """Return outputs and derivatives of 3-D bodies at incidence, the moment's parts summed up."""
    last, step, one = len(plain.mirror) - 1, plain.scale[-1], np.ones(1)
    log_re = g("Div", g("Sub", g("Gather", z, g.axes(last), axis=1), [plain.shift[-1]]), [step])
    inertia = g("Sigmoid", g("Sub", log_re, [math.log(plain.inertial)]))
    slope = g("Div", g("Mul", inertia, g("Sub", one, inertia)), [step])
    moment, by = None, None
    parts = [(inertia, slope, last)]
    parts += [(g("Gather", z, g.axes(k), axis=1), one, k) for k in plain.stokes.tolist()]
    for part, own, (factor, change, k) in zip(outputs[2:], derivatives[2:], parts, strict=True):
        unit = (np.arange(last + 1) == k).astype(float)
        changed = g("Mul", g("Mul", part, change), unit)
        term = g("Mul", factor, part), g("Add", g("Mul", factor, own), changed)
        moment = term[0] if moment is None else g("Add", moment, term[0])
        by = term[1] if by is None else g("Add", by, term[1])
    return [*outputs[:2], moment], [*derivatives[:2], by]


def _status(g, plain, precision, logarithms):
    """Return whether each case is valid, (n, 1), and its status, (n,)."""
    most = float(np.finfo(precision.dtype).max)
    least, highest = (np.clip(x, -most, most) for x in (plain.least, plain.most))
    low, high = precision.ends(plain)
    last = g.constant(np.arange(len(plain.inputs)) == len(plain.inputs) - 1, bool)
    values = g("Where", last, logarithms, "inputs")

    def number(truth):
        return g("Cast", truth, to=g.kind)

    valid = number(
        g("And", g("GreaterOrEqual", "inputs", least), g("LessOrEqual", "inputs", highest))
    )
    every = g("Unsqueeze", values, g.axes(1))  # descriptions of a body and of its mirror image
    every = g("Add", g("Mul", every, plain.signs), plain.offsets)
    inside = number(g("And", g("GreaterOrEqual", every, low), g("LessOrEqual", every, high)))
    inside = g("ReduceMax", g("ReduceMin", inside, g.axes(2), keepdims=0), g.axes(1), keepdims=1)
    valid = g("ReduceMin", valid, g.axes(1), keepdims=1)
    valid = g("Greater", valid, np.full(1, 0.5))
    status = g("Where", valid, g("Sub", np.ones(1), inside), np.full(1, 2.0))
    whole = g.helper.np_dtype_to_tensor_dtype(np.dtype("int64"))
    return valid, g("Cast", g("Squeeze", status, g.axes(1)), to=whole)

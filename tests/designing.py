"""Run by test_devices: designs with a memory that other processes share; prints counts as JSON."""

import json
import sys

from shapeopt import Designer, Problem
from surrogate import Family, Fidelity, Flow, Scene

family = Family(aspect=(1.0, 2.0), beta2=(-0.2, 0.2))
scene = Scene(family=family, fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5, wake=0))
designer = Designer(Flow(scene), memory=sys.argv[1])
numbers = [float(reynolds) for reynolds in sys.argv[2:]]
flows = [designer.design(Problem(scene, reynolds)).flows for reynolds in numbers]
print(json.dumps({"flows": sum(flows), "observations": len(designer.memory.observations)}))

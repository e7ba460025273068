"""Run by test_devices: some designs with a memory that other processes share; flows as JSON."""

import json
import sys

from shapeopt import Designer, Problem
from surrogate import Family, Fidelity, Flow, Scene
from surrogate.cache import use_compilation_cache

use_compilation_cache()
family = Family(aspect=(1.0, 2.0), beta2=(-0.2, 0.2))
scene = Scene(family=family, fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5))
designer = Designer(Flow(scene), memory=sys.argv[1])
asked = [float(reynolds) for reynolds in sys.argv[2:]]
flows = [designer.design(Problem(scene, reynolds)).flows for reynolds in asked]
print(json.dumps({"flows": sum(flows), "told": len(designer.memory.told)}))

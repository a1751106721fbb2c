"""Every public function that computes or reads, in threads, after a fork, and in new processes."""

import json
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import every_call
import pytest

MODES = [("threads", "fork"), ("forkserver", "spawn")]
# calls whose sums and products of 300 x 300 numbers had other last digits with two threads of BLAS
BY_BLAS = {
    "describe": """
s = fc.surfaces.fbm((300, 300), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
r = fc.surfaces.describe(s).drop_vars('run_time')
print([r[name].item() for name in r])
""",
    "estimate": """
s = fc.surfaces.fbm((300, 307), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
holes = s.where(np.random.default_rng(2).random(s.shape) > 0.1)
print([[fc.dimensions.estimate(z)[name].item().hex() for name in ('hurst', 'ci_low', 'ci_high')]
    for z in (s, holes, s[0])])
""",
    "directions": """
s = fc.surfaces.fbm((300, 307), 1e-4, hurst=0.5, rms_increment=1e-6, rng=1)
r = fc.dimensions.directions(s)
print([number.hex() for name in ('hurst', 'ci_low', 'ci_high') for number in r[name].values.tolist()])
""",
    "box_dimension": """
s = fc.surfaces.fbm((300, 300), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
seen = (s * 0).copy(data=np.random.default_rng(2).random(s.shape)) > 0.05
r = fc.domains.box_dimension(s > s.quantile(0.7), box_sizes=[1, 2, 100, 150], valid=seen)
print(r.null_count.values.tolist(), float(r.null_dimension), float(r.null_spread))
""",
    "transmissivity": """
from fractalcontact.joints import _network_pressure
_network_pressure.DIRECT_CELLS = 100  # beyond: by multigrid
s = fc.surfaces.fbm((200, 200), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
r = fc.joints.transmissivity((s - s.quantile(0.2)).clip(0).drop_vars('quantile').assign_attrs(units='m'))
print(r.transmissivity.values.tolist(), r.residual.values.tolist())
""",
}


def test_every_public_function_has_a_call():
    assert [name for name in every_call.names() if not every_call.has_call(name)] == []
    assert not {*every_call.FURTHER, *every_call.COMPARED} - {*every_call.names()}


@pytest.mark.processes
@pytest.mark.parametrize("modes", MODES, ids=" and ".join)
def test_every_function_returns_the_same_numbers(modes):
    """The numbers of calls one after another; no call hangs, fails or ends the process."""
    modes = [mode for mode in modes if mode in ("threads", *multiprocessing.get_all_start_methods())]
    words = [sys.executable, Path(every_call.__file__), *modes]
    done = subprocess.run(words, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.splitlines()[-1]) == {}


@pytest.mark.processes
@pytest.mark.parametrize("call", BY_BLAS)
def test_results_do_not_depend_on_the_threads_of_blas(call):
    words = [sys.executable, "-c", f"import fractalcontact as fc, numpy as np{BY_BLAS[call]}"]
    printed = {
        subprocess.run(
            words,
            env=os.environ | {"OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(printed) == 1

"""A contact problem on one set of nodes in one precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.contact._operator import Operator, PeriodicOperator
from fractalcontact.contact._preconditioner import ExtensionPreconditioner, Preconditioner
from fractalcontact.contact._scaled_problem import Problem


@dataclass(frozen=True)
class ContactSystem:
    """The gap, the bound of the pressure, the operator and the preconditioner that `ConstrainedCG` takes.

    `h` (ny, nx) is the gap of all or a part of the surface; `local_compliance` is that of `Problem`.
    """

    h: Array
    p_max: Any
    operator: Operator
    preconditioner: Preconditioner
    local_compliance: float
    dtype: Any

    def __post_init__(self) -> None:
        """Bring the gap and the bound into the precision of the system."""
        object.__setattr__(self, "h", np.ascontiguousarray(self.h, dtype=self.dtype))
        object.__setattr__(self, "p_max", self.dtype(self.p_max))

    @classmethod
    def on_plane(
        cls,
        problem: Problem,
        dtype: Any,
        local_compliance: float | None = None,
        operator: Operator | None = None,
    ) -> ContactSystem:
        """Return the system of all nodes of a problem; its operator may be given."""
        body = problem.body
        operator = operator or body.operator(dtype)
        # that of a periodic body serves both, with its array of the modes
        multiplier = operator.multiplier if isinstance(operator, PeriodicOperator) else None
        preconditioner = ExtensionPreconditioner(body, dtype, multiplier)
        scale = problem.local_compliance if local_compliance is None else local_compliance
        return cls(problem.gap, problem.p_max, operator, preconditioner, scale, dtype)

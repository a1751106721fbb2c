"""Two elastic bodies pressed together: where they touch, how hard, and how far they approach.

    closure = fractalcontact.contact.press(surface, contact_modulus=1e10, normal_force=[1e3, 1e4])

`press` presses a rigid flat down on a surface and returns a Dataset over the steps of a load path; both
elastic bodies are in the contact modulus E*, see `effective_modulus`. `flat_stiffness` is the force per
closure of a block with perfectly mating surfaces. `partial_slip` shears a pressed surface below sliding, and
`theories` returns what theories of rough contact predict. Under them lies `solver`, on plain arrays, which
the joints call: it is not listed, as users do not.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__.remove("solver")

"""Two elastic bodies pressed together: where they touch, how hard, and how far they approach.

    closure = fractalcontact.contact.press(surface, contact_modulus=1e10, normal_force=[1e3, 1e4])

`press` takes a surface, presses a rigid flat down on it (the two elastic bodies are in the contact modulus
E*, see `effective_modulus`) and returns a Dataset over the steps of the path. `flat_stiffness` is the force
per closure of the same block with perfectly mating faces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

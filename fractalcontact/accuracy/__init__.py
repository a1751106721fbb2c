"""Accuracy: error against run time of every method.

measure     true error against run time and memory of the methods of each subpackage
estimators  bias, error over the Cramer-Rao bound and coverage of the estimators of the Hurst exponent
summary     either of these results as a text table
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

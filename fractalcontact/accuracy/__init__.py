"""Accuracy: error against run time of every method, and the behaviour in extreme cases.

measure     true error against run time and memory of the methods of each subpackage
estimators  bias, error over the Cramer-Rao bound and coverage of the estimators of the Hurst exponent
cases       the catalogue of extreme surfaces, masks and calls, with what is expected of each
examine     all functions run on one case and compared with what is expected
extremes    the same for all cases, each in a child process with a time limit
summary     any of these results as a text table
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

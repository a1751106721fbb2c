"""Calls with damaged arguments, and what is wrong with the answer to one."""

import inspect
import signal
import warnings

import numpy as np
import xarray as xr
from calls import CALLS, function_of
from fuzz_values import damaged, wrong_value

from fractalcontact.base.errors import FractalContactError, FractalContactWarning, InvalidInput

# a damaged argument of this kind is never accepted where it lies on a grid
LABELLED = ("surface", "mask", "lower", "upper", "gap")


def damaged_call(pick, names=None):
    """Return the name of a function, its arguments, and what was done to each damaged one."""
    name = pick(sorted(names or CALLS))
    arguments = dict(CALLS[name]())
    signature = inspect.signature(function_of(name))
    parameters = [word for word, each in signature.parameters.items() if each.kind != each.VAR_KEYWORD]
    done = {}
    for _ in range(pick([1, 1, 1, 1, 2, 3])):
        argument = pick(parameters)
        if argument in done:
            continue
        value = arguments.get(argument)
        if isinstance(value, (xr.DataArray, xr.Dataset)) and pick([True, True, False]):
            done[argument], arguments[argument] = damaged(value, pick)
        elif isinstance(value, list) and value and pick([True, False]):
            what, entry = wrong_value(pick)
            done[argument] = f"a list with {what}"
            arguments[argument] = [*value, entry]
        else:
            done[argument], arguments[argument] = wrong_value(pick)
    return name, arguments, done


class TooSlow(BaseException):
    """A call that takes longer than its limit."""


def _stop(*_):
    raise TooSlow


def fault_of(call, *, seconds=20, names=(), refused=True):
    """Return what is wrong with a call: None for a clear error or a result without infinite numbers.

    With `refused=False` a clear error is wrong, too.

    `seconds` are those of the processors, because others may use the machine; a call that waits, for a pipe
    for example, is stopped after ten times as long.
    """
    alarms = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    before = {number: signal.signal(number, _stop) for number in alarms}
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 10 * seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", FractalContactWarning)
            warnings.filterwarnings("ignore", message=".*linear elasticity is an approximation")
            result = call()
    except FractalContactError as error:
        if not refused:
            return f"refused: {error}"
        return _unnamed(error, names) if isinstance(error, InvalidInput) else None
    except TooSlow:
        return f"longer than {seconds} s"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:200]}"
    finally:
        for number, timer in alarms.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])
    return infinite(result)


def _unnamed(error, names):
    """Return a complaint unless the error names one of the arguments (a value may be refused for another)."""
    text = str(error)
    if names and not any(name in text for name in names):
        return f"the error names none of {', '.join(names)}: {text[:200]}"
    return None


def infinite(result):
    """Return which numbers of a result are infinite, if any."""
    if isinstance(result, xr.Dataset):
        numbers = {
            str(name): np.isinf(variable.values).any()
            for name, variable in result.variables.items()
            if variable.dtype.kind == "f"
        }
        wrong = [name for name, is_infinite in numbers.items() if is_infinite]
        if wrong:
            return f"infinite {', '.join(wrong)}"
    if isinstance(result, float) and np.isinf(result):
        return "infinite"
    return None


def unexplained(result):
    """Return the names of the variables that have NaN and no reason; missing heights have none."""
    if not isinstance(result, (xr.Dataset, xr.DataArray)):
        return set()
    dataset = result.to_dataset(name=result.name or "values") if isinstance(result, xr.DataArray) else result
    return {
        str(name)
        for name, variable in dataset.variables.items()
        if variable.dtype.kind == "f"
        and name != "height"
        and np.isnan(variable.values).any()
        and not ("reason" in variable.attrs or "NaN" in variable.attrs.get("comment", ""))
    }


def silently_accepted(done, arguments):
    """Return what must have been refused: coordinates or heights that are no numbers, for example."""
    for argument, what in done.items():
        if argument in LABELLED and what.isupper():
            return f"{argument}: {what.lower()} accepted"
    return None

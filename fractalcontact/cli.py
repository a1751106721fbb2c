"""The command `fractalcontact`: run a scene, answer a question, measure accuracy, show what a file has.

Exit codes: 0 success, 1 too little memory, an error of the file system, or some of many scans failed, 2
invalid input (nothing was written), 130 or 143 stopped by SIGINT or SIGTERM. SIGINT finishes the current task
and keeps the results; a second SIGINT stops at once.
"""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Any

import fractalcontact as fc  # loads its subpackages when they are used
from fractalcontact.base import errors, files
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.process import block_dask_import, collect_rarely, peak_memory
from fractalcontact.base.resources import most_workers, require_libraries
from fractalcontact.base.signals import Stop, Stopped, leaving, noted

FAILED, WRONG_INPUT, STOPPED = 1, 2, 128  # and the number of the signal: as of a shell (POSIX)
READING = ("spacing", "units", "channel")  # of `surfaces.read`
TEMPLATE_ARGUMENTS = (  # of `scenes.template`; options of these names give them
    *READING, "level", "despike", "young", "poisson", "register", "turn_upper",
    "basic_friction_angle", "wall_strength",
)  # fmt: skip
ESTIMATOR_OPTIONS = ("hurst", "sizes", "families", "methods", "members", "seed")  # of `accuracy estimators`
HELP = {  # of options, where it is long
    "run folder": "folder for result.nc, the report and the figures (default: the name of the scene); a "
    "stopped run resumes there",
    "accuracy folder": "folder for the results (NetCDF) and figures; after a stop of `estimators` the same "
    "command continues",
    "question folder": "folder for the results (default: SCAN_QUESTION, without suffix; of many scans "
    "their folder)",
    "plan": "print the stages, their reasons and their memory; run nothing",
    "workers": "share scans, members, shears and directions between N processes (default 0: this process)",
    "scheduler": "share them between the workers of this dask scheduler instead (tcp://host:8786); of many "
    "scans they need the files and the folder of the results",
    "faces": "files of both faces, in one frame, heights up, the upper one above the lower; of many joints "
    "all lower faces, then all upper ones in the same order, or a pattern for each in quotes",
    "surfaces": "files of the surfaces, or a pattern in quotes: every format of fractalcontact.surfaces.read",
    "turn": "the upper body was scanned with its face up: turn it over about this axis",
    "angle": "basic friction angle, degree",
    "jcs": "compressive strength of the joint walls, Pa or with its unit; with --friction-angle: shear "
    "strength, and a datasheet",
    "level": "remove the mean plane (1, the default unless the surface is periodic) or quadric (2); 0 "
    "keeps the tilt",
    "young": "Young's modulus of both bodies, Pa, or with its unit: 30e9, 30GPa",
    "units": "unit of the heights (z), and of the coordinates of points: m, mm, um ... (default: that of "
    "the file, else m)",
    "spacing": "distance between the points, or of the cells, m, or with its unit: 3e-4, 0.3mm",
    "channel": "channel of an instrument's file, band of a raster or array of .npz, .mat or .h5, by its name "
    "or its number from 0; name of a variable of NetCDF",
    "benchmarks": "surfaces, dimensions, contact, domains, joints: error against run time of their methods "
    "(default: all); or estimators: bias, error over the Cramer-Rao bound and coverage of the estimators "
    "of roughness",
    "mated": "do not move the upper face into mated position",
}
QUESTIONS = {
    "roughness": "fractal dimension with its interval, JRC and directional roughness of a scan",
    "contact": "contact of a scan with a flat under growing pressure",
    "joint": "closure, dilatancy and leakage of two scanned faces",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser, commands = _parsers()
    options, unknown = parser.parse_known_args(arguments)
    if unknown:  # with the usage of the command, which has the options
        commands[options.command].error(f"unrecognized arguments: {' '.join(unknown)}")
    if arguments is None:
        collect_rarely()
        if getattr(options, "scheduler", None) is None:
            block_dask_import()
    warnings.showwarning = _WarningPrinter()
    try:
        require_libraries()
        with leaving(_leave):
            code: int = options.action(options)
    except errors.FractalContactError as error:
        print(error, file=sys.stderr)
        return FAILED if isinstance(error, errors.TooLittleMemory) else WRONG_INPUT
    except Stopped as stop:
        print(stop, file=sys.stderr)
        return STOPPED + stop.number
    except MemoryError as error:
        print(f"fractalcontact: the memory of this machine does not suffice ({error})", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:  # of a file or folder that is written, or of the terminal
        name = "" if error.filename is None else f"{Path(os.fsdecode(error.filename)).name!r}: "
        print(f"fractalcontact: {name}{error.strerror or error}", file=sys.stderr)
        return FAILED
    return code


def command_help() -> dict[str, str]:
    """Return what `--help` prints for every command, by its name."""
    return {name: parser.format_help() for name, parser in _parsers()[1].items()}


def _parsers() -> tuple[argparse.ArgumentParser, Mapping[str, argparse.ArgumentParser]]:
    """Return the parser of the command line, and that of each command by its name."""
    parser = argparse.ArgumentParser(
        prog="fractalcontact",
        description="Rough surfaces in contact: roughness, contact, closure, dilatancy and shear strength.",
    )
    parser.add_argument("--version", action="version", version=f"fractalcontact {fc.__version__}")
    commands = parser.add_subparsers(required=True, dest="command", metavar="command")

    def command(name: str, action: Callable[..., int], line: str) -> argparse.ArgumentParser:
        """Add a command and return its parser."""
        added = commands.add_parser(name, help=line)
        added.set_defaults(action=action)
        return added

    run = command("run", _run, "run a scene: one NetCDF file, figures, a summary")
    run.add_argument("scene", help="a scene file (TOML), or the name of a shipped scene")
    run.add_argument("-o", "--out", help=HELP["run folder"])
    run.add_argument("--plan", action="store_true", help=HELP["plan"])
    _add_run_options(run)

    for question, line in QUESTIONS.items():
        asked = command(question, _answer, line)
        asked.set_defaults(question=question, plan=False)
        _add_question_options(asked, question)
        _add_run_options(asked)

    init = command("init", _init, "write a commented scene to start from")
    init.add_argument("scene", nargs="?", default="scene.toml", help="the file to write (default scene.toml)")

    accuracy = command("accuracy", _accuracy, "measure error against run time on this machine")
    accuracy.add_argument("names", nargs="*", metavar="NAME", help=HELP["benchmarks"])
    accuracy.add_argument("-o", "--out", help=HELP["accuracy folder"])
    accuracy.add_argument("--budget", type=float, help="time budget of benchmarks in seconds (default 60)")
    add = accuracy.add_argument_group("estimators").add_argument
    add("--hurst", type=float, nargs="+", help="exponents (default .1 .3 .5 .7 .9)")
    add("--sizes", type=int, nargs="+", help="points along an edge (default 64 256 1024)")
    add("--families", nargs="+", help="fbm, spectral, crop, matern, profile (default fbm spectral)")
    add("--methods", nargs="+", help="names from `fractalcontact methods` (default: all)")
    add("--members", type=int, nargs="+", help="surfaces for each case (default 25600 / size)")
    add("--seed", type=int, help="seed of the random stream")

    command("methods", _methods, "list the estimators of fractal dimension")

    report = command("report", _report, "write the report of a result file: one HTML file")
    report.add_argument("file", help="a result file of `fractalcontact run`")
    report.add_argument("-o", "--out", help="the file to write (default: report.html beside the result)")
    report.add_argument("--csv", metavar="FOLDER", help="also write every curve there as a CSV file")

    export = command("export", _export, "write the maps of a result file for ParaView or Fiji")
    add = export.add_argument
    add("file", help="a result file: heights, and the maps that [want] keep stores")
    add("--to", choices=("vti", "tiff"), default="vti", help="VTK image data (default) or stacks of TIFF")
    add("-o", "--out", help="folder for the files (default: maps beside the result)")
    add("--force", action="store_true", help="overwrite files of the same names")

    info = command("info", _info, "show variables, achieved errors and run times of a result file")
    info.add_argument("file", help="a NetCDF file that this package wrote")
    return parser, commands.choices


def _add_run_options(command: argparse.ArgumentParser) -> None:
    """Add what all commands that run a scene take."""
    add = command.add_argument
    add("--quiet", action="store_true", help="no progress bars and no summary")
    add("--verbose", action="store_true", help="all tables, remarks and caveats, and the time of every stage")
    add("--force", action="store_true", help="overwrite results of another study and files of others")
    add("--workers", type=int, default=0, metavar="N", help=HELP["workers"])
    add("--scheduler", metavar="ADDRESS", help=HELP["scheduler"])


def _pascal(text: str) -> float:
    """Return a pressure in Pa, given as a number or with its unit: `30 GPa`."""
    from fractalcontact.base.units import pascals

    return _or_refused(pascals(text), "a pressure in Pa, or with its unit (30 GPa)", text)


def _metre(text: str) -> float:
    """Return a length in metres, given as a number or with its unit: `0.3 mm`."""
    from fractalcontact.base.units import metres

    return _or_refused(metres(text), "a length in metres, or with its unit (0.3 mm)", text)


def _channel(text: str) -> str | int:
    """Return the number or the name of a channel."""
    return int(text) if text.isdecimal() else text


def _or_refused(value: float | None, expected: str, text: str) -> float:
    """Return the value of an option; refuse the option where it has none."""
    if value is None:
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
    return value


def _add_question_options(command: argparse.ArgumentParser, question: str) -> None:
    """Add what a command takes that answers one question to a scan."""
    add = command.add_argument
    if question == "joint":
        add("scans", nargs="+", metavar="LOWER UPPER", help=HELP["faces"])
        add("--as-scanned", dest="register", action="store_false", help=HELP["mated"])
        add("--turn-upper", choices=("x", "y"), help=HELP["turn"])
        add("--friction-angle", dest="basic_friction_angle", type=float, metavar="ANGLE", help=HELP["angle"])
        add("--jcs", dest="wall_strength", type=_pascal, metavar="JCS", help=HELP["jcs"])
    else:
        add("scans", nargs="+", metavar="SCAN", help=HELP["surfaces"])
        add("--level", type=int, choices=(0, 1, 2), help=HELP["level"])
    if question != "roughness":
        add("--young", type=_pascal, required=True, help=HELP["young"])
        add("--poisson", type=float, default=0.2, help="Poisson's ratio (default 0.2)")
    add("--despike", action="store_true", help="remove spikes of the scan")
    add("--units", help=HELP["units"])
    add("--spacing", type=_metre, help=HELP["spacing"])
    add("--channel", type=_channel, help=HELP["channel"])
    add("-o", "--out", help=HELP["question folder"])
    add("--scene", action="store_true", help="print the scene and run nothing")


def _answer(options: argparse.Namespace) -> int:
    """Run the scene of a question, and write it beside its results."""
    import tomllib

    scan, upper = _scans(options)
    several, folder = isinstance(scan, list) or files.is_pattern(scan), options.out
    if folder is None:
        first = Path(scan[0] if isinstance(scan, list) else scan)
        stem = first.resolve().parent.name.replace("*", "") if several else first.name.partition(".")[0]
        folder = f"{stem}_{options.question}"
    arguments = {name: getattr(options, name) for name in TEMPLATE_ARGUMENTS if hasattr(options, name)}
    for name, option, what, unit in (
        ("young", "--young", "softer than any solid", "GPa"),
        ("wall_strength", "--jcs", "weaker than any rock", "MPa"),
    ):
        value = arguments.get(name)
        if value is not None and 0 < value < 1e4:  # Pa: below the softest gels, and the weakest clays
            errors.warn(f"{option}: {value:g} Pa is {what}; is it {value:g} {unit}?", errors.ScaleWarning)
    place = "." if options.scene else folder
    if options.question == "roughness" and not options.scene and not several:
        reading = {name: arguments[name] for name in READING if arguments[name] is not None}
        heights = fc.surfaces.read(scan, **reading)
        if heights.dims == ("x",):
            return _profile_roughness(heights, Path(folder), Path(scan).name, options)
        arguments["surface"] = heights
    text = fc.scenes.template(options.question, scan, upper, folder=place, **arguments)
    if options.scene:
        print(text)
        return 0
    target = Path(folder) / f"{options.question}.toml"
    if not options.force and target.exists() and not _is_unedited(target.read_text(encoding="utf-8")):
        remedy = f"fractalcontact run {target} -o {folder} runs it, --force overwrites it"
        expected = "no scene of yours under the name of the one that is written"
        got = f"{target.name!r} ({remedy})"
        raise InvalidInput.of(f"fractalcontact {options.question}", "-o", expected, got)
    scene = fc.scenes.Scene(options.question, tomllib.loads(text), Path(folder).absolute())
    options.out, options.scene = folder, scene
    is_refused = False
    try:
        return _run(options)
    except InvalidInput:
        is_refused = True
        raise
    finally:
        if Path(folder).is_dir() and not is_refused:  # also after a stop
            target.write_text(f"{_mark(text)}\n{text}", encoding="utf-8")


def _scans(options: argparse.Namespace) -> tuple[Any, Any]:
    """Return the file, files or pattern of a command, and those of the upper faces of joints."""
    scans = options.scans
    if options.question != "joint":
        return (scans if len(scans) > 1 else scans[0]), None
    half = len(scans) // 2
    lower, upper = scans[:half], scans[half:]
    if len(lower) != len(upper):
        expected = "as many files of lower as of upper faces"
        raise InvalidInput("fractalcontact joint", [f"expected {expected}, got {len(scans)} in all"])
    if half == 1:
        return lower[0], upper[0]
    pairs = list(zip(lower, upper, _own_parts(lower), _own_parts(upper), strict=True))
    wrong = [f"{a} and {b}" for a, b, own, other in pairs if own != other]
    if wrong:
        remedy = "give patterns in quotes, or a scene with two lists"
        expected = f"pairs of files whose names differ by the face alone ({remedy})"
        raise InvalidInput("fractalcontact joint", [f"expected {expected}, got {', '.join(wrong)}"])
    return lower, upper


def _own_parts(names: Sequence[str]) -> list[str]:
    """Return names without what they all begin and end with."""
    rests = [name[_same_letters(names) :] for name in names]
    return [rest[: len(rest) - _same_letters([each[::-1] for each in rests])] for rest in rests]


def _same_letters(names: Sequence[str]) -> int:
    """Return how many letters names have in common at their beginning."""
    return len(list(takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))))


def _profile_roughness(heights: Any, folder: Path, name: str, options: argparse.Namespace) -> int:
    """Print and save the dimension and the roughness coefficient of a profile, which need no scene."""
    import xarray as xr

    title, target = f"Roughness of the profile {name}", folder / files.RESULT
    if target.exists() and not options.force and fc.open(target).attrs.get("title") != title:
        expected = "a folder without results of another study (another folder, or --force)"
        raise InvalidInput.of("fractalcontact roughness", "-o", expected, repr(folder.name))
    profile = fc.surfaces.despike(heights) if options.despike else heights
    level = 1 if options.level is None else options.level
    levelled = fc.surfaces.level(profile, level) if level else profile
    groups = {
        "/surfaces": levelled.to_dataset(name="height"),
        "/dimensions": fc.dimensions.estimate(levelled),
        "/joints/roughness_coefficient": fc.joints.roughness_coefficient(levelled),
    }
    tree = xr.DataTree.from_dict(groups)
    tree.attrs["title"] = title
    fc.save(tree, target)
    if not options.quiet:
        print(f"{fc.scenes.summary(tree, verbose=options.verbose)}\n\nwritten: {target}")
    return 0


def _mark(text: str) -> str:
    """Return the first line of a scene that a command wrote, which shows whether it was edited since."""
    return f"# Written by fractalcontact; checksum {zlib.crc32(text.encode()):08x}"


def _is_unedited(text: str) -> bool:
    first, _, rest = text.partition("\n")
    return first == _mark(rest)


def _init(options: argparse.Namespace) -> int:
    """Write a commented scene and the schema that its first line names; an existing scene stays."""
    target, shipped = Path(options.scene), files.datasets_folder()
    if target.exists() or not target.parent.is_dir():
        expected = "the name of a new file in an existing folder"
        raise InvalidInput.of("fractalcontact init", "scene", expected, repr(target.name))
    target.write_text((shipped / "new_scene.toml").read_text(encoding="utf-8"), encoding="utf-8")
    target.with_name(files.SCHEMA).write_bytes((shipped / files.SCHEMA).read_bytes())
    print(f"written: {target}, and {files.SCHEMA} for editors\nfractalcontact run {target} -o out")
    return 0


def _run(options: argparse.Namespace) -> int:
    from fractalcontact.base.tables import screen_width
    from fractalcontact.base.units import number
    from fractalcontact.base.validation import Problems

    if options.plan:
        print(fc.scenes.plan(fc.scenes.validate(options.scene)))
        return 0
    with Problems("fractalcontact run") as problems:
        problems.integer("--workers", options.workers, at_least=0, at_most=most_workers())
    speaks = not options.quiet
    out = Path(options.out or Path(str(options.scene)).stem)
    more = {"verbose": options.verbose, "workers": options.workers, "force": options.force}
    with _client(options.scheduler) as client:
        tree = fc.scenes.run(options.scene, out=out, progress=speaks, summary=speaks, client=client, **more)
    if speaks:
        figures = len(list(out.glob("*.png")))
        size = (out / files.RESULT).stat().st_size
        drawn = f" and {figures} figure{'s' * (figures > 1)}" if figures else ""
        memory = f"; peak memory {peak / 1e6:.0f} MB" if (peak := peak_memory()) else ""
        written = f"written to {out}: {files.RESULT} ({number(size / 1e6, 2)} MB), report.html{drawn}{memory}"
        print("\n" + textwrap.fill(written, screen_width(), subsequent_indent="  ", break_long_words=False))
        print(f"next: open {out / 'report.html'} in a browser")
    has_failed = "overview" in tree.children and (tree["overview/status"] != "done").any()
    return FAILED if has_failed else 0


@contextmanager
def _client(address: str | None) -> Iterator[Any]:
    """Provide a client of a dask scheduler; None without an address."""
    if address is None:
        yield None
        return
    errors.require_library("--scheduler", "distributed", "dask")
    from distributed import Client

    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        expected = "the address of a running dask scheduler"
        raise InvalidInput.of("fractalcontact run", "--scheduler", expected, repr(address)) from error
    with client:
        yield client


def _accuracy(options: argparse.Namespace) -> int:
    from fractalcontact.base.validation import Problems

    measures_estimators = options.names == ["estimators"]
    others, place = (("budget",), "with") if measures_estimators else (ESTIMATOR_OPTIONS, "except with")
    with Problems("fractalcontact accuracy") as problems:
        for name in others:
            value = getattr(options, name)
            problems.require(value is None, f"--{name}", f"no value {place} `estimators`", value)
    if options.out is not None:
        files.output_folder(options.out)  # before the measuring, not after it
    if measures_estimators:
        return _estimators(options)
    budget = {} if options.budget is None else {"budget": options.budget}
    with noted() as stop:
        result = fc.accuracy.measure(options.names or None, **budget, progress=True, stop=stop)
    print(fc.accuracy.summary(result))
    if options.out is not None:
        written = [_save_accuracy(result, Path(options.out) / "accuracy.nc", stop)]
        for name, part in () if stop else result.children.items():
            written.append(f"{name}.png")
            _write_figure(part.to_dataset(), Path(options.out) / written[-1])
        print(f"\nwritten to {options.out}: {', '.join(written)}")
    if stop:
        raise Stopped(stop.number, "the results so far are printed above")
    return 0


def _write_figure(result: Any, path: Path) -> None:
    """Write the figure of a result as PNG."""
    figure = fc.plotting.plot(result).flat[0].figure
    figure.savefig(path, dpi=150)  # 13 pixels for the height of text of 6 points


def _save_accuracy(result: Any, target: Path, stop: Stop) -> str:
    """Save a result and return the name of the file, which is another one where the run was stopped."""
    partial = target.with_name(files.PARTIAL_RESULT)
    if not stop:
        partial.unlink(missing_ok=True)
    return fc.save(result, partial if stop else target).name


def _estimators(options: argparse.Namespace) -> int:
    given = {name: getattr(options, name) for name in ESTIMATOR_OPTIONS}
    arguments = {name: value for name, value in given.items() if value is not None}
    seed = arguments.pop("seed", None)
    file = None if options.out is None else Path(options.out) / "estimators.nc"
    result = fc.accuracy.estimators(**arguments, rng=seed, file=file, progress=True)
    print(fc.accuracy.summary(result))
    if file is not None:
        _write_figure(result, file.with_suffix(".png"))
        print(f"\nwritten to {options.out}: estimators.nc, estimators.png")
    return 0


def _report(options: argparse.Namespace) -> int:
    tree = fc.open(options.file)
    path = fc.scenes.report(tree, options.out or Path(options.file).with_name("report.html"))
    print(f"written: {path}")
    if options.csv is not None:
        print(f"written to {options.csv}: {len(fc.scenes.tables(tree, options.csv))} CSV files")
    return 0


def _export(options: argparse.Namespace) -> int:
    folder = options.out or Path(options.file).with_name("maps")
    written = fc.scenes.export(fc.open(options.file), folder, to=options.to, force=options.force)
    first, number = written[0].name, len(written)
    print(f"written to {folder}: {f'1 file, {first}' if number == 1 else f'{number} files, {first} ...'}")
    return 0


def _methods(options: argparse.Namespace) -> int:
    del options
    from fractalcontact.base.tables import screen_width

    for name, line in fc.dimensions.methods().items():
        print(textwrap.fill(f"{name:<20} {line}", screen_width(), subsequent_indent=" " * 21))
    return 0


def _info(options: argparse.Namespace) -> int:
    from fractalcontact.base.file_contents import file_contents

    print(file_contents(options.file))
    return 0


class _WarningPrinter:
    """Prints every warning once, whatever it comes from."""

    def __init__(self) -> None:
        self.printed: set[str] = set()

    def __call__(self, message: Any, category: Any, *_: Any, **__: Any) -> None:
        """Print a warning, in the place of `warnings.showwarning`."""
        text = f"{getattr(category, '__name__', 'warning')}: {message}"
        if text not in self.printed:
            self.printed.add(text)
            print(text, file=sys.stderr)


def _leave(number: int, _: object) -> None:
    """End at once, whatever the threads do: no incomplete file has a final name."""
    os.write(2, b"stopped\n")
    os._exit(STOPPED + number)


if __name__ == "__main__":
    raise SystemExit(main())

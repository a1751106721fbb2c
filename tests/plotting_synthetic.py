"""A small synthetic study with the variables and labels of real results and freely chosen numbers."""

import numpy as np
import xarray as xr

from fractalcontact.base.schema import label


def heights(n=48, spacing=8e-4, seed=0):
    """Return a labelled, rough surface of n x n points with a slope."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.rfftfreq(n), indexing="ij"))
    waves[0, 0] = np.inf
    modes = np.fft.rfft2(rng.standard_normal((n, n))) * waves**-1.8
    z = np.fft.irfft2(modes, (n, n))
    x = (np.arange(n) + 0.5) * spacing
    z = 2.5e-4 * z / z.std() + 0.06 * x
    return label(xr.DataArray(z - z.mean(), dims=("y", "x"), coords={"y": x, "x": x}, name="height"))


def delta(surface, cells=24, shears=(8e-4, 8e-3), direction="W"):
    """Return the labelled delta-surfaces of a mated block in the middle of a surface."""
    n, spacing = surface.sizes["x"], float(surface.x[1] - surface.x[0])
    first = (n - cells) // 2
    block = surface.isel(x=slice(first, first + cells), y=slice(first, first + cells))
    planes = [
        surface.values[first : first + cells, first - k : first - k + cells] - block.values
        for k in (round(v / spacing) for v in shears)
    ]
    coords = {"shear": list(shears), "y": block.y, "x": block.x, "direction": direction, "azimuth": 180.0}
    return label(xr.DataArray(np.array(planes), dims=("shear", "y", "x"), coords=coords, name="height"))


def path_coords(shears, forces, planes=None):
    """Return the coordinates of a result over (shear, step)."""
    coords = {
        "shear": list(shears),
        "step": np.arange(len(forces)),
        "normal_force": ("step", np.asarray(forces, float)),
    }
    if planes is not None:
        coords |= {"y": planes.y, "x": planes.x}
    return coords


def closure(delta_surface, forces=(0.0, 100.0, 1e3, 1e4, 3e4)):
    """Return closure laws of the form F ~ w^2, with states cut out of the delta-surface by height."""
    shears, forces = delta_surface.shear.values, np.asarray(forces)
    own = 2e-6 * np.sqrt(forces)[None, :] * (1 + np.arange(len(shears)))[:, None] / 4
    fraction = 1e-6 * forces[None, :] / (1 + np.arange(len(shears)))[:, None]
    z = delta_surface.values
    cut = np.array([[np.quantile(plane, 1 - q) for q in row] for plane, row in zip(z, fraction, strict=True)])
    state = (z[:, None] > cut[..., None, None]).astype(np.int8)
    dims = ("shear", "step")
    return label(
        xr.Dataset(
            {
                "closure": (dims, own + 2.8e-9 * forces),
                "interface_closure": (dims, own),
                "bulk_closure": (dims, np.broadcast_to(2.8e-9 * forces, own.shape)),
                "contact_fraction": (dims, fraction * 1.3),
                "corrected_contact_fraction": (dims, fraction),
                "state": ((*dims, "y", "x"), state),
            },
            coords=path_coords(shears, forces, delta_surface),
        )
    )


def dilatancy(shears=None, forces=(1e3, 1e4, 3e4), directions=("E", "N", "W", "S")):
    """Return dilatancy curves with a plateau and a mean slope."""
    shears = np.arange(0, 1.0e-2, 8e-5) if shears is None else np.asarray(shears)
    slope = np.array([0.06, 0.01, -0.06, -0.01, 0.02])[: len(directions)]
    rigid = 1.5e-3 * (1 - np.exp(-shears / 4e-4)) + slope[:, None] * shears
    data = {
        "rigid_dilatancy": (("direction", "shear"), rigid),
        "mean_slope": ("direction", slope),
        "basic_friction_angle": ((), 35.0),
    }
    coords = {"direction": list(directions), "shear": shears}
    if len(forces):
        closed = 2e-6 * np.sqrt(forces)
        data["dilatancy"] = (
            ("direction", "shear", "step"),
            rigid[..., None] - closed * np.tanh(shears / 3e-4)[:, None],
        )
        coords |= {"step": np.arange(len(forces)), "normal_force": ("step", np.asarray(forces))}
    return label(xr.Dataset(data, coords=coords))


def friction(opening):
    """Return the friction angle of dilatancy curves by differences."""
    name = "dilatancy" if "dilatancy" in opening else "rigid_dilatancy"
    angle = np.rad2deg(np.arctan(opening[name].differentiate("shear")))
    angle = angle.clip(-10, 40)
    total = 35.0 + angle
    data = {"dilatancy_angle": angle, "friction_angle": total, "basic_friction_angle": ((), 35.0)}
    if name == "dilatancy":
        data["shear_strength"] = opening["normal_force"] / 4e-4 * np.tan(np.deg2rad(total))
    return label(xr.Dataset(data))


def box_dimension(closed):
    """Return box dimensions that grow with the force, beside those of a random null."""
    fraction = closed["corrected_contact_fraction"]
    value = 2 + np.log(fraction.where(fraction > 0)) / 8
    data = {
        "box_dimension": value,
        "ci_low": value - 0.08,
        "ci_high": value + 0.08,
        "null_dimension": value - 0.2,
        "coverage": fraction,
    }
    return label(xr.Dataset(data).drop_vars([n for n in ("x", "y") if n in fraction.coords]))


def lacunarity(closed, sizes=(1, 2, 4, 8, 16)):
    """Return lacunarities 1 + (1/coverage - 1) / r, beside those of a random null."""
    fraction = closed["corrected_contact_fraction"]
    edge = xr.DataArray(list(sizes), dims="box_size", coords={"box_size": list(sizes)})
    value = 1 + (1 / fraction.where(fraction > 0) - 1) / edge
    data = {"lacunarity": value, "null_lacunarity": 1 + (value - 1) / edge}
    return label(xr.Dataset(data).assign_coords(box_length=edge * 8e-5))


def estimates(methods=("default", "spectrum", "variogram", "cube_counts")):
    """Return estimates; the last method has no interval."""
    hurst = 0.78 + 0.01 * np.arange(len(methods))
    width = np.full(len(methods), 0.03)
    width[-1] = np.nan
    data = {
        "hurst": ("method", hurst),
        "fractal_dimension": ("method", 3 - hurst),
        "standard_error": ("method", width / 2),
        "ci_low": ("method", hurst - width),
        "ci_high": ("method", hurst + width),
        "scale_min": ("method", np.full(len(methods), 2e-4)),
        "scale_max": ("method", np.full(len(methods), 4e-3)),
    }
    return label(xr.Dataset(data, coords={"method": list(methods)}))


def curves():
    """Return power laws as scaling curves."""
    lag = 8e-5 * 2.0 ** np.arange(9)
    wave = 2 * np.pi / lag[::-1]
    laws = {
        "spectrum": ("wavenumber", wave, "power_spectral_density", 1e-3 * wave**-3.56, -3.56),
        "variogram": ("lag", lag, "variogram", 1e-3 * lag**1.56, 1.56),
        "cube_counts": ("cube_size", lag, "cube_count", 1e-4 * lag**-2.22, -2.22),
    }
    return {
        name: label(
            xr.Dataset({value: (scale, y), "local_slope": (scale, np.full(x.size, slope))}, coords={scale: x})
        )
        for name, (scale, x, value, y, slope) in laws.items()
    }


def islands(plane):
    """Return the labelled islands of one mask (y, x)."""
    from scipy import ndimage

    numbers, count = ndimage.label(plane.values > 0)
    cell = float(plane.x[1] - plane.x[0]) ** 2
    area = np.bincount(numbers.ravel(), minlength=count + 1)[1:] * cell
    data = {
        "label": (("y", "x"), numbers.astype(np.int32)),
        "area": ("island", area),
        "n_islands": ((), count),
    }
    coords = {"y": plane.y, "x": plane.x, "island_label": ("island", np.arange(1, count + 1))}
    return label(xr.Dataset(data, coords=coords))


def transmissivity(closed):
    """Return hydraulic apertures that fall with the force; flow along y is blocked at the last step."""
    force = closed["normal_force"].values
    shears = closed["shear"].values
    aperture = 1e-4 * (1 + np.arange(len(shears)))[:, None, None] * np.exp(-force / 2e4)[None, :, None]
    aperture = aperture * np.array([1.0, 0.8])
    aperture[..., -1, 1] = 0.0
    coords = path_coords(shears, force) | {"axis": ["x", "y"]}
    return label(xr.Dataset({"hydraulic_aperture": (("shear", "step", "axis"), aperture)}, coords=coords))


def accuracy():
    """Return two parts of error against run time; one method stops early."""
    size = np.array([8.0, 16.0, 32.0, 64.0])
    error = np.array([1 / size, 4 / size**2])
    error[1, -1] = np.nan
    dims = ("method", "setting")
    seconds = 1e-6 * size**2 * np.array([[1.0], [3.0]])
    data = {"error": (dims, error), "run_time": (dims, seconds), "memory": (dims, 1e8 * seconds)}
    data["on_pareto_front"] = (dims, np.array([[True, True, False, False], [False, True, True, False]]))
    coords = {"method": ["plain", "fast, disc"], "setting": np.arange(4)}
    coords |= {
        "benchmark": ("method", ["sphere", "sphere"]),
        "error_meaning": ("method", ["of the force"] * 2),
    }
    part = label(xr.Dataset(data, coords=coords))
    return xr.DataTree.from_dict({"/contact": part, "/joints": part.copy()})


def study():
    """Return a complete study as a tree, with the groups of a scene."""
    surface = heights()
    shears = (8e-4, 1.6e-3, 8e-3)
    under = delta(surface, shears=shears)
    closed = closure(under)
    short = dilatancy(shears=[0, 8e-5, 1.6e-4, 4e-4, 8e-4, 8e-3], directions=("W",))
    groups = {
        "/surfaces": surface.to_dataset(),
        "/dimensions": estimates(),
        "/joints/delta_surface": under.to_dataset(),
        "/joints/closure": closed,
        "/joints/rigid_dilatancy": dilatancy(forces=()),
        "/joints/elastic_dilatancy": short,
        "/joints/friction": friction(short),
        "/joints/transmissivity": transmissivity(closed),
        "/domains/box_dimension": box_dimension(closed),
        "/domains/lacunarity": lacunarity(closed),
        "/domains/islands": islands(closed["state"].isel(shear=0, step=-1)),
    } | {f"/dimensions/{name}": curve for name, curve in curves().items()}
    return xr.DataTree.from_dict(groups, name="synthetic")

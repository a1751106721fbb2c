"""The tangential elastic operator, displacement from traction, and its approximate inverse on a contact.

Everything is for a contact modulus of 1 and two like bodies, or an elastic one on a rigid one, with Poisson's
ratio nu. A point force along x displaces the surface of a half-space by (Cerruti 1882; Johnson 1985, 3.6)

    u_x = (lambda + e cos 2 theta) / (pi r),   u_y = e sin 2 theta / (pi r),                       (1)

lambda = (2 - nu)/(2 (1 - nu)), e = nu/(2 (1 - nu)). In wave numbers that is 2/|k| along the wave vector k and
2/((1 - nu)|k|) across it. Without Poisson effect, nu = 0, it is the normal operator for each direction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import in_bands
from fractalcontact.contact._operator import convolution_symbol, padded_length
from fractalcontact.contact._preconditioner import FADE, bin_layout, bin_tables
from fractalcontact.contact._problem import Body


class TangentialOperator:
    """Displacement (2, nodes) of the nodes in contact under a traction (2, nodes) on them.

    Free bodies are solved on the box that holds the contact.
    """

    def __init__(self, body: Body, contact: Array, poisson: float) -> None:
        self.poisson, self.body = poisson, body
        self.contact = contact
        if not body.periodic:
            rows, columns = (np.flatnonzero(contact.any(axis=axis)) for axis in (1, 0))
            self.contact = contact[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            shape = (self.contact.shape[0], self.contact.shape[1])
            self.body = Body(shape, body.spacing, False, body.influence, body.radius)
        self.shape = self.body.shape
        # traction of a node that is displaced by 1 against its surroundings: roughly, as it serves
        # preconditioner and first guess; .3 and 3 times as much took up to 7 and 3 % more transforms
        self.node_stiffness = 1.0 / float(np.sqrt(body.cell_area))
        self.nodes = np.flatnonzero(self.contact)
        self.transforms = 0  # pairs
        self.multiplier: WaveVectorMultiplier | ConvolutionMultiplier
        if body.periodic:
            self.multiplier = WaveVectorMultiplier(self.shape, body.spacing, poisson)
        else:
            self.multiplier = ConvolutionMultiplier(tangential_coefficients(self.body, poisson))

    def apply(self, q: Array) -> Array:
        """Return the displacement under the traction q; without its mean over the plane if periodic."""
        self.transforms += 2
        planes = np.zeros((2, self.shape[0] * self.shape[1]))
        planes[:, self.nodes] = q
        u = self.multiplier.apply(planes.reshape(2, *self.shape))
        return np.asarray(u.reshape(2, -1)[:, self.nodes])


class WaveVectorMultiplier:
    """Multiplies the modes of two planes by the symbol of the half-space, or by that of its inverse."""

    def __init__(
        self, shape: tuple[int, int], spacing: tuple[float, float], poisson: float, *, inverse: bool = False
    ) -> None:
        self.shape, self.inverse = shape, inverse
        self.qy = fft.wavenumbers(shape[0], spacing[0])
        self.qx = fft.wavenumbers(shape[1], spacing[1], real=True)
        # the highest mode of an even number of nodes has no sign: x and y are not coupled there
        self.signed_qy, self.signed_qx = self.qy.copy(), self.qx.copy()
        if shape[0] % 2 == 0:
            self.signed_qy[shape[0] // 2] = 0.0
        if shape[1] % 2 == 0:
            self.signed_qx[-1] = 0.0
        # along k, and across it over along it, less 1
        self.factor, self.excess = (0.5, -poisson) if inverse else (2.0, poisson / (1 - poisson))
        extent = float(np.sqrt(shape[0] * spacing[0] * shape[1] * spacing[1]))
        self.mean = 1.0 / extent if inverse else 0.0

    def apply(self, planes: Array) -> Array:
        """Return the planes (2, ny, nx), which may be overwritten, with their modes multiplied."""
        from fractalcontact.contact._kernels import multiply_by_wave_vectors

        modes = [fft.rfft2(plane) for plane in planes]
        waves = (self.qy, self.qx, self.signed_qy, self.signed_qx)
        weights = (self.factor, self.excess, self.inverse, self.mean)
        parts = [fft.real_parts(plane) for plane in modes]
        in_bands(multiply_by_wave_vectors, modes[0].shape[0], 2 * modes[0].size, *parts, *waves, *weights)
        for plane, out in zip(modes, planes, strict=True):
            fft.irfft2(plane, self.shape, out, overwrite=True)
        return planes


class ConvolutionMultiplier:
    """Convolves two planes with the influence coefficients, padded so that nothing wraps around."""

    def __init__(self, tables: tuple[Array, Array, Array]) -> None:
        isotropic, cosine, sine = tables
        shape = isotropic.shape
        self.padded = (padded_length(shape[0]), padded_length(shape[1]))
        self.symbol_xx = convolution_symbol(isotropic + cosine, self.padded)
        self.symbol_yy = convolution_symbol(isotropic - cosine, self.padded)
        self.symbol_xy = convolution_symbol(sine, self.padded, odd=True)

    def apply(self, planes: Array) -> Array:
        """Return the convolutions of the planes (2, ny, nx), which are overwritten."""
        from fractalcontact.contact._kernels import multiply_by_symbols

        modes = [fft.rfft2_padded(plane, self.padded) for plane in planes]
        symbols = (self.symbol_xx, self.symbol_yy, self.symbol_xy)
        parts = [fft.real_parts(plane) for plane in modes]
        in_bands(multiply_by_symbols, modes[0].shape[0], 2 * modes[0].size, *parts, *symbols)
        for plane, out in zip(modes, planes, strict=True):
            out[...] = fft.irfft2_cropped(plane, self.padded, (out.shape[0], out.shape[1]))
        return planes


def tangential_coefficients(body: Body, poisson: float) -> tuple[Array, Array, Array]:
    """Return the parts lambda, e cos 2 theta and e sin 2 theta of (1) at offset (i, j), for unit traction.

    On rigid circular plates of radius a (Johnson 1985, 3.7; away from the plate itself)

        lambda asin(a/r)/(pi a),    e (1 - a^2/r^2)^(1/2)/(pi r) times cos 2 theta and sin 2 theta,

    else means over a rectangular cell under uniform traction, in closed form.
    """
    factor = poisson / (2 - 2 * poisson)
    if body.influence == "disc":
        y = np.arange(body.shape[0])[:, None] * body.spacing[0]
        x = np.arange(body.shape[1])[None, :] * body.spacing[1]
        r2 = x**2 + y**2
        r2[0, 0] = np.inf
        size = np.sqrt(np.maximum(1 - body.radius**2 / r2, 0.0) / r2) / (np.pi * r2) * body.cell_area
        cosine, sine = size * (x**2 - y**2), size * (2 * x * y)
    else:
        cosine, sine = (table * body.cell_area for table in cell_anisotropy(body.shape, body.spacing))
    return (1 + factor) * body.influence_table(), factor * cosine, factor * sine  # lambda = 1 + e


def cell_anisotropy(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    *,
    # half as many points change the displacement by 2e-14, more of them or the closed form up to 16 cells by
    # nothing
    orders: Sequence[tuple[int, int]] = ((8, 8), (20, 5), (100, 3)),
) -> tuple[Array, Array]:
    """Return the means of cos 2 theta/(pi r) and sin 2 theta/(pi r) over the cell at offset (i, j).

    `orders` has distances in cells and the points of the quadrature from there on. Nearer cells take the
    closed form, which loses digits with the distance.
    """
    cosine, sine = np.empty(shape), np.empty(shape)
    i, j = np.arange(shape[0])[:, None], np.arange(shape[1])[None, :]
    reach = np.maximum(i * spacing[0], j * spacing[1]) / max(spacing)
    near = np.nonzero(reach < orders[0][0])
    cosine[near], sine[near] = _corner_sums(near[0] * spacing[0], near[1] * spacing[1], spacing)
    limits = [*(limit for limit, _ in orders[1:]), np.inf]
    for (limit, order), stop in zip(orders, limits, strict=True):
        points, weights = np.polynomial.legendre.leggauss(order)
        cells = np.nonzero((reach >= limit) & (reach < stop))
        total = np.zeros((2, cells[0].size))
        for point_y, weight_y in zip(points, weights, strict=True):
            y = (cells[0] + point_y / 2) * spacing[0]
            for point_x, weight_x in zip(points, weights, strict=True):
                x = (cells[1] + point_x / 2) * spacing[1]
                scale = weight_y * weight_x / 4 / np.pi / (x * x + y * y) ** 1.5
                total += scale * np.stack([x * x - y * y, 2 * x * y])
        cosine[cells], sine[cells] = total
    return cosine, sine


def _corner_sums(y: Array, x: Array, spacing: tuple[float, float]) -> tuple[Array, Array]:
    """Return the means over cells near the origin: x^2/r^3 integrates to Y ln(X + R), xy/r^3 to -R."""
    cosine, sine = np.zeros(y.shape), np.zeros(y.shape)
    for sign_y in (-1, 1):
        for sign_x in (-1, 1):
            b, a = y + sign_y * spacing[0] / 2, x + sign_x * spacing[1] / 2
            sign = sign_y * sign_x
            cosine += sign * (b * np.arcsinh(a / np.abs(b)) - a * np.arcsinh(b / np.abs(a)))
            sine -= sign * 2 * np.hypot(a, b)
    area = np.pi * spacing[0] * spacing[1]
    return cosine / area, sine / area


class TangentialPreconditioner:
    """The inverse of K + C on the free directions of a contact, roughly.

    `direction` (2, nodes) is the unit vector in which a slipping node cannot move, zero where it sticks; the
    compliance C (nodes) acts on the other direction of a slipping node. (K + C)^-1 r is the least of

        w' S w + (r - w)' C^-1 (r - w)     over the displacements w of all nodes,

    S the inverse of the half-space. As in `_preconditioner`, w = E r is a smooth extension instead of the
    least: r where the surfaces stick, its mean m outside and along the direction of a slipping node, and
    between the two, a r + (1 - a) m with a = 1/(1 + C s), in the other direction, s a local stiffness. Any E
    gives a symmetric positive preconditioner. Without C in it the iterations are three times as many.
    """

    def __init__(self, operator: TangentialOperator, direction: Array, compliance: Array) -> None:
        body, self.operator = operator.body, operator
        self.edges, self.plane_shape, self.bins = bin_layout(body)
        self.multiplier = WaveVectorMultiplier(self.plane_shape, body.spacing, operator.poisson, inverse=True)
        spacing = (body.spacing[0] * self.edges[0], body.spacing[1] * self.edges[1])
        self.poisson_kernel = bin_tables(self.bins, spacing, "d")[0]
        row, column = np.divmod(operator.nodes, body.shape[1])
        self.nodes = row * self.plane_shape[1] + column
        self.bin_of_node = row // self.edges[0] * self.bins[1] + column // self.edges[1]
        self.mask = np.zeros(self.plane_shape, dtype=np.bool_)
        self.mask.reshape(-1)[self.nodes] = True

        stiffness = operator.node_stiffness
        slips = direction.any(axis=0)
        self.across = np.stack([-direction[1], direction[0]])
        share = 1 / (1 + compliance * stiffness)
        xx, yy, xy = (self.across[a] * self.across[b] * share for a, b in ((0, 0), (1, 1), (0, 1)))
        self.share = (np.where(slips, xx, 1.0), np.where(slips, yy, 1.0), xy)
        self.spring = np.where(slips, compliance * (stiffness * share) ** 2, 0.0)  # (1 - a)^2 / C
        xx, yy, xy = (self.smooth(self.sum_nodes(values)) for values in self.share)
        faded = FADE * self.edges[0] * self.edges[1]
        xx, yy = np.maximum(xx, 0) + faded, np.maximum(yy, 0) + faded
        determinant = np.maximum(xx * yy - xy**2, faded**2)
        self.weight = (yy / determinant, xx / determinant, -xy / determinant)

    def sum_nodes(self, values: Array) -> Array:
        """Sum values at the nodes over the bins."""
        return np.bincount(self.bin_of_node, values, self.bins[0] * self.bins[1]).reshape(self.bins)

    def smooth(self, bins: Array) -> Array:
        """Apply the Poisson kernel to the bins."""
        return fft.irfft2(fft.rfft2(bins) * self.poisson_kernel, self.bins)

    def apply(self, r: Array) -> Array:
        """Return roughly the traction (2, nodes) that displaces the nodes by r against K + C."""
        from fractalcontact.contact._kernels import fill_outside, sum_outside

        self.operator.transforms += 2
        grid, size = (*self.edges, self.mask), self.mask.size
        sums = [self.smooth(self.sum_nodes(values)) for values in symmetric_product(self.share, r)]
        mean = symmetric_product(self.weight, np.stack(sums))
        mean_at_nodes = mean.reshape(2, -1)[:, self.bin_of_node]
        planes = np.zeros((2, *self.plane_shape))
        for plane, bins in zip(planes, mean, strict=True):
            in_bands(fill_outside, self.bins[0], size, *grid, bins, plane)
        rest = r - mean_at_nodes
        planes.reshape(2, -1)[:, self.nodes] = mean_at_nodes + symmetric_product(self.share, rest)
        y = self.multiplier.apply(planes)
        outside = np.empty((2, *self.bins))
        for plane, bins in zip(y, outside, strict=True):
            in_bands(sum_outside, self.bins[0], size, *grid, plane, bins)
        y = y.reshape(2, -1)[:, self.nodes]
        inner = symmetric_product(self.share, y)
        spring = self.across * (self.spring * np.sum(rest * self.across, axis=0))
        outside += np.stack([self.sum_nodes(values) for values in y - inner - spring])
        back = np.stack([self.smooth(bins) for bins in symmetric_product(self.weight, outside)])
        back = back.reshape(2, -1)[:, self.bin_of_node]
        return np.asarray(inner + spring + symmetric_product(self.share, back))


def symmetric_product(matrix: tuple[Array, Array, Array], vector: Array) -> Array:
    """Return the product of symmetric matrices (xx, yy, xy) and vectors (2, ...)."""
    xx, yy, xy = matrix
    return np.stack([xx * vector[0] + xy * vector[1], xy * vector[0] + yy * vector[1]])

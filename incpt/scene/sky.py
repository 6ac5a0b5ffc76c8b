"""A clear sky by the height of its sun: light that air, dust and ozone scatter once.

After T. Nishita et al., *Display of the Earth Taking into Account Atmospheric Scattering* (SIGGRAPH 1993), in
a spectrum of 21 wavelengths, with the absorption of ozone. It is the model that Blender calls Nishita or
single scattering, with its parameters; light that is scattered more than once is left out, so that skies are
a bit too dark, after sunset much.

A sky is tabulated as a lat-long image whose middle is the sun's azimuth, and the sun itself is told apart: it
is smaller than a texel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.checks import require_bool
from incpt.scene.checks import set_number
from incpt.scene.image import Image

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT = 1024, 512
"""Of the image, texels."""

_EARTH, _TOP = 6.36e6, 6.42e6
"""Radii of the Earth and of the end of its atmosphere, metres."""
_AIR_SCALE, _DUST_SCALE = 8e3, 1.2e3
"""Heights over which air and dust get thinner by a factor of e, metres (Nishita et al., section 3)."""
_DUST_SCATTERING, _DUST_EXTINCTION = 2e-5, 2.22e-5
"""Of dust at sea level, per metre, for all wavelengths (Bruneton and Neyret 2008)."""
_DUST_FORWARD = 0.76
"""How far dust scatters forward: g of the phase function of Cornette and Shanks (1992)."""
_OZONE_BASE, _OZONE_PEAK, _OZONE_END = 10e3, 25e3, 40e3
"""Heights between which there is ozone, in a triangle, metres."""
_OZONE_COLUMN = 8.07e22
"""Molecules per square metre: 300 Dobson units."""
_SUN_KELVIN, _SUN_SOLID_ANGLE = 5778.0, 6.80e-5
"""Temperature of a black body like the sun, and what the sun covers of the sky, sr."""
_WAVELENGTHS = np.linspace(380.0, 780.0, 21)
"""In nanometres."""
_OZONE_CROSS_SECTIONS = 1e-27 * np.array(
    [0.282, 1.53, 5.52, 15.8, 36.7, 77.5, 148, 214, 309, 427, 440, 502, 374, 266, 185, 121, 74.6, 51.1, 42.3,
     24.5, 25.3]
)  # fmt: skip
"""Of an ozone molecule at 233 K for these wavelengths, square metres (Serdyuchenko et al. 2014)."""
_RGB_FROM_XYZ = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""To linear Rec. 709 with its white point D65."""
_VIEW_STEPS, _SUN_STEPS = 48, 24
"""Places along a ray of view, and along the way from each of them to the sun."""
_BLOCKED = 1e15
"""A column that lets nothing through, metres."""
_ELEVATIONS, _AZIMUTHS = 80, 9
"""Places of the sky at which the integrals are made; they are smooth between them."""


@dataclass(frozen=True)
class Sky:
    """A clear sky; the sun stands over the middle of the environment's image, +z where it is not turned.

    sun_elevation  of the sun's middle above the horizon, degrees; below it, it is night but for the twilight.
    sun_disc       whether the sun itself shines; else only what the atmosphere scatters.
    sun_size       angular diameter of the sun, degrees. A larger one is dimmer, and gives as much light.
    sun_intensity  factor of the light that comes from the sun itself.
    altitude       of the observer above the sea, metres.
    air            density of the air's molecules, which make the sky blue; 1: that of a clear day.
    dust           of dust and droplets, which make a bright haze about the sun; 1: that of a clear day.
    ozone          of the ozone layer, which makes the sky bluer, most at twilight; 1: 300 Dobson units.
    ground         reflectance of the ground below the horizon, which is lit by sun and sky; 0: it is black.
    """

    sun_elevation: float = 15.0
    sun_disc: bool = True
    sun_size: float = 0.545
    sun_intensity: float = 1.0
    altitude: float = 0.0
    air: float = 1.0
    dust: float = 1.0
    ozone: float = 1.0
    ground: float = 0.3

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            set_number(self, name, low, high)
        require_bool("sun_disc", self.sun_disc)

    @property
    def image(self) -> Image:
        """Radiance (HEIGHT, WIDTH) without the sun itself; the same Image for skies that differ in the sun
        alone."""
        return _image(*self.atmosphere)

    @property
    def atmosphere(self) -> tuple[float, ...]:
        """What the image depends on."""
        return self.sun_elevation, self.altitude, self.air, self.dust, self.ozone, self.ground

    @property
    def has_sun(self) -> bool:
        """Whether the sun itself shines."""
        return self.sun_disc and self.sun_intensity > 0 and max(self.sun_irradiance) > 0

    @property
    def sun_direction(self) -> Vector:
        """Towards the sun, unit length, where the image is not turned."""
        elevation = math.radians(self.sun_elevation)
        return 0.0, math.sin(elevation), math.cos(elevation)

    @property
    def sun_chord(self) -> float:
        """The distance of a unit vector towards the sun's rim from that towards its middle. The disk covers
        pi times its square of the sphere."""
        return 2 * math.sin(math.radians(self.sun_size) / 4)

    @property
    def sun_irradiance(self) -> Vector:
        """Of a surface that faces the sun, without what the atmosphere scatters."""
        at_sea = _sun_irradiance(self.sun_elevation, self.altitude, self.air, self.dust, self.ozone)
        r, g, b = (self.sun_intensity * self._risen * c for c in at_sea)
        return r, g, b

    @property
    def sun_radiance(self) -> Vector:
        """Of all points of the disk alike."""
        r, g, b = (c / (math.pi * self.sun_chord**2) for c in self.sun_irradiance)
        return r, g, b

    @property
    def _risen(self) -> float:
        """The share of the sun's disk that is above the horizon."""
        at = min(max(self.sun_elevation / (self.sun_size / 2), -1.0), 1.0)
        return 1 - (math.acos(at) - at * math.sqrt(1 - at * at)) / math.pi


_RANGES: dict[str, tuple[float, float]] = {
    "sun_elevation": (-90.0, 90.0),
    "sun_size": (0.01, 90.0),
    "sun_intensity": (0.0, 1e6),
    "altitude": (0.0, 5e4),
    "air": (0.0, 10.0),
    "dust": (0.0, 10.0),
    "ozone": (0.0, 10.0),
    "ground": (0.0, 1.0),
}


@lru_cache(maxsize=8)
def _image(
    sun_elevation: float, altitude: float, air: float, dust: float, ozone: float, ground: float
) -> Image:
    elevation = math.radians(sun_elevation)
    densities = np.array([air, dust, ozone])
    longitude = (np.arange(WIDTH) + 0.5) * 2 * np.pi / WIDTH - np.pi
    latitude = np.pi / 2 - (np.arange(HEIGHT // 2) + 0.5) * np.pi / HEIGHT
    by_air, by_dust = _scattered(elevation, altitude, densities, latitude, np.abs(longitude))
    cosine = np.sin(elevation) * np.sin(latitude)[:, None]
    cosine = cosine + np.cos(elevation) * np.cos(latitude)[:, None] * np.cos(longitude)
    sky = _air_phase(cosine)[..., None] * by_air + _dust_phase(cosine)[..., None] * by_dust
    sky = np.maximum(sky, 0.0)
    texel = (2 * np.pi / WIDTH) * (np.pi / HEIGHT) * np.cos(latitude) * np.sin(latitude)
    received = (sky * texel[:, None, None]).sum(axis=(0, 1))
    from_sun = np.array(_sun_irradiance(sun_elevation, altitude, air, dust, ozone))
    below = ground / np.pi * (received + max(math.sin(elevation), 0.0) * from_sun)
    pixels = np.concatenate([sky, np.broadcast_to(below, sky.shape)])
    return Image(np.ascontiguousarray(pixels, np.float32))


@lru_cache(maxsize=8)
def _sun_irradiance(
    sun_elevation: float, altitude: float, air: float, dust: float, ozone: float
) -> tuple[float, float, float]:
    """Of a surface that faces the sun; as from the horizon where it is below."""
    elevation = max(math.radians(sun_elevation), 0.0)
    start, towards = np.array([0.0, _EARTH + altitude]), np.array([math.cos(elevation), math.sin(elevation)])
    columns = _columns(start, towards) * [air, dust, ozone]
    r, g, b = np.maximum(_rgb(_sunlight() * np.exp(-columns @ _extinctions())), 0.0).tolist()
    return r, g, b


def _scattered(
    sun: float, altitude: float, densities: Array, latitude: Array, azimuth: Array
) -> tuple[Array, Array]:
    """What air and dust scatter towards the observer, without their phase functions: (H, W, 3) each, for
    directions of these elevations and azimuths from the sun's, all in radians."""
    # Near the horizon the air changes fastest, so that places stand closer there.
    grid = np.linspace(0, 1, _ELEVATIONS)
    elevations, azimuths = np.pi / 2 * grid**2, np.linspace(0, np.pi, _AZIMUTHS)
    up, across = np.sin(elevations), np.cos(elevations)
    start = _EARTH + altitude
    length = np.sqrt((start * up) ** 2 + _TOP**2 - start**2) - start * up
    t = np.linspace(0, 1, _VIEW_STEPS)
    way = length[:, None] * t**2  # (E, S)
    # Positions in the plane of the ray, first along the horizon, then up from the middle of the Earth.
    along, high = way * across[:, None], start + way * up[:, None]
    density = _densities(np.hypot(along, high) - _EARTH) * densities  # (E, S, 3)
    step = np.diff(way, axis=1)[..., None]
    before = np.cumsum(step * (density[:, 1:] + density[:, :-1]) / 2, axis=1)
    before = np.concatenate([np.zeros_like(before[:, :1]), before], axis=1)
    # The way to the sun, in the plane of the point, the sun and the middle of the Earth.
    radius = np.hypot(along, high)[:, None, :]
    cosine = along[:, None] * math.cos(sun) * np.cos(azimuths)[:, None] + high[:, None] * math.sin(sun)
    cosine = np.clip(cosine / radius, -1, 1)
    points = np.stack(np.broadcast_arrays(0.0, radius), axis=-1) + np.zeros((*cosine.shape, 1))
    after = _columns(points, np.stack([np.sqrt(1 - cosine**2), cosine], axis=-1)) * densities
    light = _sunlight() * np.exp(-(before[:, None] + after) @ _extinctions())  # (E, A, S, wavelengths)
    found = []
    for kind, scattering in enumerate(_scatterings()):
        spectrum = np.trapezoid(light * density[:, None, :, kind, None], way[:, None, :, None], axis=2)
        found.append(_between(_rgb(spectrum * scattering), grid, azimuths, latitude, azimuth))
    return found[0], found[1]


def _between(table: Array, grid: Array, azimuths: Array, latitude: Array, azimuth: Array) -> Array:
    """(H, W, 3) a table (E, A, 3) at elevations and azimuths, linearly between its entries."""
    place = np.interp(np.sqrt(latitude / (np.pi / 2)), grid, np.arange(len(grid)))
    row = np.minimum(place.astype(int), len(grid) - 2)
    share = (place - row)[:, None, None]
    rows = (1 - share) * table[row] + share * table[row + 1]
    place = np.interp(azimuth, azimuths, np.arange(len(azimuths)))
    column = np.minimum(place.astype(int), len(azimuths) - 2)
    share = (place - column)[:, None]
    between: Array = (1 - share) * rows[:, column] + share * rows[:, column + 1]
    return between


def _densities(height: Array) -> Array:
    """(..., 3) of air, dust and ozone at heights above the sea, relative to their greatest."""
    height = np.maximum(height, 0.0)
    rising = (height - _OZONE_BASE) / (_OZONE_PEAK - _OZONE_BASE)
    falling = (_OZONE_END - height) / (_OZONE_END - _OZONE_PEAK)
    ozone = np.maximum(np.minimum(rising, falling), 0.0)
    return np.stack([np.exp(-height / _AIR_SCALE), np.exp(-height / _DUST_SCALE), ozone], axis=-1)


def _columns(start: Array, towards: Array) -> Array:
    """(..., 3) how much of air, dust and ozone is on the ways from points (..., 2) in unit directions
    (..., 2) out of the atmosphere, metres of their greatest density; _BLOCKED where the Earth is in the way.
    The middle of the Earth is (0, 0)."""
    ahead = (start * towards).sum(axis=-1)
    squared = (start * start).sum(axis=-1)
    length = np.sqrt(np.maximum(ahead**2 + _TOP**2 - squared, 0.0)) - ahead
    nearest = squared - ahead**2
    is_blocked = (ahead < 0) & (nearest < _EARTH**2)
    t = np.linspace(0, 1, _SUN_STEPS)
    way = length[..., None] * t**2
    height = np.sqrt(squared[..., None] + way * (way + 2 * ahead[..., None])) - _EARTH
    columns = np.trapezoid(_densities(height), way[..., None], axis=-2)
    found: Array = np.where(is_blocked[..., None], _BLOCKED, columns)
    return found


def _scatterings() -> tuple[Array, Array]:
    """Scattering of air and of dust (wavelengths,) at their greatest density, per metre."""
    # Rayleigh's law for a refractive index of 1.00029 and the molecules of air at sea level, 2.504e25 / m^3.
    index, molecules = 1.00029, 2.504e25
    air = 8 * np.pi**3 * (index**2 - 1) ** 2 / (3 * molecules * (_WAVELENGTHS * 1e-9) ** 4)
    return air, np.full(len(_WAVELENGTHS), _DUST_SCATTERING)


def _extinctions() -> Array:
    """(3, wavelengths) of air, dust and ozone at their greatest density, per metre."""
    most_ozone = _OZONE_COLUMN / ((_OZONE_END - _OZONE_BASE) / 2)
    dust = np.full(len(_WAVELENGTHS), _DUST_EXTINCTION)
    return np.stack([_scatterings()[0], dust, most_ozone * _OZONE_CROSS_SECTIONS])


def _sunlight() -> Array:
    """(wavelengths,) irradiance outside of the atmosphere, W/m^2/nm: Planck's law."""
    metres = _WAVELENGTHS * 1e-9
    radiance = 1.191043e-16 / metres**5 / np.expm1(1.438777e-2 / (metres * _SUN_KELVIN))
    sunlight: Array = radiance * _SUN_SOLID_ANGLE * 1e-9
    return sunlight


def _air_phase(cosine: Array) -> Array:
    """Of Rayleigh, per steradian."""
    return 3 / (16 * np.pi) * (1 + cosine**2)


def _dust_phase(cosine: Array) -> Array:
    """Of Cornette and Shanks, per steradian."""
    g = _DUST_FORWARD
    phase: Array = 3 / (8 * np.pi) * (1 - g * g) / (2 + g * g) * (1 + cosine**2)
    return phase / (1 + g * g - 2 * g * cosine) ** 1.5


@lru_cache(maxsize=1)
def _matching() -> Array:
    """(wavelengths, 3) linear red, green and blue of one unit per nanometre in each band."""

    def lobe(middle: float, left: float, right: float) -> Array:
        off = _WAVELENGTHS - middle
        return np.exp(-0.5 * (off / np.where(off < 0, left, right)) ** 2)

    # C. Wyman, P.-P. Sloan and P. Shirley, Simple Analytic Approximations to the CIE XYZ Color Matching
    # Functions, JCGT 2(2), 2013.
    x = 1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2)
    y = 0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1)
    z = 1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8)
    step = float(_WAVELENGTHS[1] - _WAVELENGTHS[0])
    return np.asarray(step * np.stack([x, y, z], axis=-1) @ _RGB_FROM_XYZ.T)


def _rgb(spectra: Array) -> Array:
    """(..., 3) linear colours of spectra (..., wavelengths) per nanometre."""
    rgb: Array = spectra @ _matching()
    return rgb

"""Types of the document of fits: the models in order, their parameters with intervals, and the remaining error."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from brdfdb.figure import DocumentPart
from brdfdb.fitting.nuisance import NuisanceKind
from brdfdb.fitting.residuals import Kind
from brdfdb.materials import Material

ALBEDO_ANGLES_DEG = (0.0, 30.0, 60.0, 75.0, 85.0)  # theta_i at which the albedo of every fit is computed
ALBEDO_TOLERANCE = 1e-3  # absolute tolerance of these albedos

Method = Literal["covariance", "profile", "end of range", "incidences", "several fits"]


class Estimate(DocumentPart):
    """One number of a fit with its uncertainty, angles in degrees."""

    name: str = Field(description="parameter, as recipes write it; of a sum after the name of its term")
    channel: str | None = Field(description="channel of a number that each channel has; null: shared by all")
    unit: str
    value: float
    standard_error: float | None = Field(description="null: at an end of its range, or not determined by the samples")
    low: float = Field(description="lower end of the 95 % interval, within the range of the model")
    high: float
    method: Method = Field(
        description="covariance: from the derivatives at the best point. profile: where the cost of the best fit with "
        "this number fixed rises by 3.84 times its noise. end of range: the best value is an end of the range of the "
        "model, and no profile was computed. incidences: from fits with incidences left out in turn, as residuals are "
        "correlated. several fits: over fits with proposed nuisance numbers, or with other residuals. Fits "
        "other than the best have the first and the third method only: intervals are too narrow where residuals form a "
        "pattern"
    )


class Correlation(DocumentPart):
    """A pair of numbers that the samples hardly distinguish."""

    first: str
    second: str
    coefficient: float
    sentence: str


class HeldOutIncidences(DocumentPart):
    """Prediction of samples at incidences that were left out of the fit, one group after the other."""

    theta_i_deg: list[list[float]] = Field(description="polar angles of the light of each group")
    rms_ln: list[float] = Field(description="root mean square of ln(model / sample) of each group")
    rms: float = Field(
        description="the same over all samples that were left out in turn, less the outliers of every fit"
    )
    median: float = Field(description="median of abs(ln(model / sample)) over them")


class FitAlbedo(DocumentPart):
    """The largest directional albedo of a fit, at the channel that reflects most."""

    theta_i_deg: float
    value: float
    error: float = Field(description="estimated error of the quadrature")
    conserves: bool = Field(description="false: the fit reflects more light than arrives")

    @classmethod
    def largest(cls, theta_i_deg: ArrayLike, albedo: ArrayLike, error: ArrayLike) -> FitAlbedo:
        """Return the largest of some albedos [1], with its angle and the error of its quadrature."""
        largest = np.argmax(albedo)
        angle, value, wrong = (float(np.asarray(array)[largest]) for array in (theta_i_deg, albedo, error))
        conserves = value <= 1.0 + wrong + ALBEDO_TOLERANCE
        return cls(theta_i_deg=angle, value=value, error=wrong, conserves=conserves)


class Outlier(DocumentPart):
    """A sample with a large residual of the best fit."""

    theta_i_deg: float
    phi_i_deg: float
    theta_r_deg: float
    phi_r_deg: float
    channel: str
    value: float = Field(description="f_r of the sample, in 1/sr")
    model: float = Field(description="f_r of the best fit, in 1/sr")
    sigmas: float = Field(description="its residual over the robust standard deviation of all residuals")


class Fit(DocumentPart):
    """One model, or sum of models, fitted to the samples."""

    model: str = Field(description="a model of the registry, or models joined by +")
    estimates: list[Estimate]
    rms_ln: float | None = Field(
        description="root mean square of ln(model / sample) over positive samples, less the outliers of every fit"
    )
    median_ln: float | None = Field(description="median of its absolute value")
    nuisance: list[Estimate] = Field(default=[], description="nuisance numbers of the measurement that were fitted")
    proposed: list[NuisanceKind] = Field(
        default=[], description="nuisance numbers whose pattern the residuals show; of the best fit only"
    )
    noise_floor: float | None = Field(
        default=None,
        description="f_r, in 1/sr, at which the floor of the noise is as large as its part in proportion; null: the "
        "samples show none, or the residual has none",
    )
    sigma: float = Field(description="robust standard deviation of the residuals: 1.4826 times their median size")
    held_out: HeldOutIncidences | None = Field(description="null: the light has one direction only")
    numbers: int = Field(description="numbers that were searched")
    aic: float = Field(description="Akaike's criterion, N ln(2 cost / N) + 2 p, of the robust cost")
    bic: float = Field(description="Schwarz's criterion, N ln(2 cost / N) + p ln N")
    pattern: float = Field(
        description="correlation of each residual with that of the nearest sample: 0 for noise, 1 for a model that is "
        "wrong by a smooth function"
    )
    at_mirror: int = Field(
        description="samples near the mirror direction that are left out: the fit has a specular part there, and the "
        "instrument states no solid angle"
    )
    albedo: FitAlbedo
    correlations: list[Correlation]
    remarks: list[str]
    material: Material | None = Field(description="the fit as a material; null for a sum")
    recipe: str | None = Field(description="the material as a part of a recipe, [define.NAME] in TOML")


class UnusedSamples(DocumentPart):
    """Values of the samples that no fit uses."""

    below_horizon: int = Field(description="values of the file with a direction below the horizon")
    holes: int
    at_horizon: int = Field(description="a direction at 90 degrees, where models are 0")
    unusable: int = Field(
        description="not positive, where logarithms or relative differences are taken; without a positive finite "
        "uncertainty, where differences are over it"
    )


class Fits(DocumentPart):
    """All models that were fitted to some samples, best first."""

    name: str
    provenance: str
    samples: int = Field(description="number of values that the fits use")
    incidences: int
    channels: list[str]
    wavelengths_nm: list[float] | None
    assumed_wavelength_nm: float | None = Field(description="for models with n and k, where the samples state none")
    residual: Kind
    refractive_index: str | None
    nuisance: list[NuisanceKind] = Field(default=[], description="kinds of fitted nuisance numbers")
    source_solid_angle_sr: float | None = Field(description="solid angle of the light; null: not known")
    receiver_solid_angle_sr: float | None = Field(description="solid angle of the receiver; null: not known")
    left_out: UnusedSamples
    remarks: list[str] = Field(description="on the samples, and on the residual for them")
    ranked_by: Literal["held-out rms of ln", "BIC"]
    fits: list[Fit]
    outliers: list[Outlier] = Field(description="the farthest samples of the best fit, farthest first")
    outlier_count: int = Field(description="samples farther than 6 robust standard deviations from the best fit")
    shared_outlier_count: int = Field(
        description="samples farther than that from every fit, which the errors and the ranking leave out; 0 if they "
        "are more than 2 % of all samples, because they are then not accidents"
    )
    skipped: dict[str, str] = Field(description="models that were not fitted, with the reason")
    interrupted: bool = Field(
        description="true: the search ended before all models, or the intervals of the best model, were computed"
    )

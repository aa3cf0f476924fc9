"""The finding on glints and samples: what a table misses is named, and a glint is not a jump or an error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.audit import MaterialAudit, audit
from brdfdb.audit.energy import Energy
from brdfdb.audit.glints import GlintsFinding, checks_of, resting_on
from brdfdb.measurements.glints import Glint, Glints
from brdfdb.measurements.record import AtSamples, IncidenceEnergy, Noise, WorstSample
from brdfdb.store.publication import publish
from tests.tables.glinting import GROUND, PEAK, source


def _audited(root: Path, error: float, energy: float, **more: float) -> MaterialAudit:
    """Audit the table with glints whose record says how far a sample and an incidence are off."""
    place = {"theta_i_deg": 60.0, "phi_i_deg": 0.0, "channel": "grey"}
    worst = WorstSample(**place, theta_r_deg=60.5, phi_r_deg=180.0, sample=PEAK, table=PEAK * (1 - error), error=error)
    energies = [IncidenceEnergy(**place, samples=0.5, table=0.5 * (1.0 - energy), error=energy)]
    at_samples = AtSamples(worst=worst, energies=energies, **({"p95": 0.01} | more))
    made = source().recorded(at_samples=at_samples, extrapolated=0.986)
    publish(root, made, tolerance=0.05)
    return audit(brdfdb.open(root)[made.name])


def test_a_table_with_glints_passes_where_it_was_measured_and_the_finding_names_them(tmp_path: Path) -> None:
    audited = _audited(tmp_path, 0.02, 0.01)
    assert audited.verdict == "passes", audited.problems()
    assert audited.verdict_in_words == "passes where measured, 1.4 %"
    assert audited.as_published.text == "passes where measured, 1.4 %"
    assert audited.conserves_energy.text.startswith("the data do where measured, 1.4 %: albedo 0.911 at 60")
    finding = audited.of(GlintsFinding)
    assert finding.verdict == "passes"
    assert [check.glint.theta_i_deg for check in finding.glints] == [30.0, 60.0]
    assert "one glint" not in finding.problems()[0]
    assert finding.problems()[0].startswith(
        "2 glints kept beside the grid, which cannot hold such peaks: of light at 30"
    )
    assert finding.cells()[0].text == "2 % off, 2 glints"
    power = PEAK * np.cos(np.deg2rad(60.5)) * 2.0 * np.pi * np.deg2rad(0.4) ** 2
    assert audited.of(Energy).table.max_albedo == pytest.approx(np.pi * GROUND + power, abs=3e-3)
    assert audited.of(Energy).table.max_at_theta_i_deg == pytest.approx(60.0)


def test_a_missed_sample_and_a_missed_incidence_are_named(tmp_path: Path) -> None:
    lost = _audited(tmp_path, 0.3, 0.5)
    assert lost.verdict == "violates"
    assert lost.as_published.text == "no: energy of incidences"
    audited = _audited(tmp_path, 0.3, 0.05)
    finding = audited.of(GlintsFinding)
    assert finding.verdict == "outside"
    assert audited.verdict == "passes"  # noise does so, too
    sample, energy, _ = finding.problems()
    assert "worst 30 % at theta_i 60°, phi_i 0°, theta_r 60.5°, phi_r 180° (5000 /sr; table 3500 /sr)" in sample
    assert energy == "energy, summed over the samples: 1 incidence off by more than 2 %: 5 % at theta_i 60°, phi_i 0°"


def test_a_verdict_names_the_share_of_the_samples_that_the_table_misses(tmp_path: Path) -> None:
    """231 of 724 samples off by more than 5 %, the worst by 217 %, are not a plain pass; noise of them all is."""
    audited = _audited(tmp_path, 2.17, 0.01, p95=0.4, within=1.0 - 231.0 / 724.0)
    text = "passes where measured, 1.4 %; 32 % of the samples off by more than 5 %"
    assert audited.verdict_in_words == audited.as_published.text == text
    measured = brdfdb.open(tmp_path)["glinting"].metadata.measured
    assert measured is not None
    noisy = measured.model_copy(update={"noise": Noise(median=0.2, p95=0.2)})
    assert resting_on(noisy) == "where measured, 1.4 %"


def test_doubts_about_the_file_are_sentences_of_the_audit_and_named_in_its_verdict(tmp_path: Path) -> None:
    doubts = ["Azimuths? Lobes turn: import the file with --azimuth mirror.", "3 values are -99: do they mean missing?"]
    publish(tmp_path, source().recorded(doubts=doubts, extrapolated=0.986), tolerance=0.05)
    audited = audit(brdfdb.open(tmp_path)["glinting"])
    text = "passes where measured, 1.4 %; the file leaves doubts: azimuths, 3 values are -99"
    assert audited.verdict_in_words == audited.as_published.text == text
    assert [said.text for said in audited.sentences if said.title == "Doubt about the file"] == doubts
    assert audited.problems()[:2] == doubts
    assert audited.conserves_energy.text.startswith("the data do where measured, 1.4 %: albedo")  # not of energy
    assert audited.questions == ("is it what the data say?", "do the data conserve energy?")
    measured = brdfdb.open(tmp_path)["glinting"].metadata.measured
    assert measured is not None
    everywhere = measured.model_copy(update={"extrapolated": None})
    assert resting_on(everywhere) == "but the file leaves doubts: azimuths, 3 values are -99"


def test_the_asymmetry_of_a_glint_is_that_of_its_power_and_place() -> None:
    """A glint of 0.1 at 30 and 0.3 at 50 degrees in the mirror direction is symmetric; one off by 2 degrees is not."""
    on = Glints(
        glints=tuple(Glint(theta_i_deg=t, width_deg=0.5, resolved=True, power=(p,)) for t, p in ((30, 0.1), (50, 0.3)))
    )
    assert [check.asymmetry for check in checks_of(on)] == [0.0, 0.0]
    off = Glints(glints=(Glint(theta_i_deg=40.0, in_plane_deg=2.0, width_deg=0.5, resolved=True, power=(0.1,)),))
    # light and viewer exchanged, the viewer is 4 degrees, or 8 widths, from where the glint goes
    assert checks_of(off)[0].asymmetry == 1.0
    assert checks_of(Glints(glints=(Glint(theta_i_deg=40.0, width_deg=1.0, resolved=True, power=(0.0,)),))) == []


def test_an_albedo_above_1_by_a_glint_that_is_not_resolved_is_no_violation(tmp_path: Path) -> None:
    for resolved, verdict in ((False, "passes"), (True, "violates")):
        glint = Glint(theta_i_deg=60.0, width_deg=0.4, resolved=resolved, power=(1.5,))
        publish(tmp_path, source().recorded(glints=Glints(glints=(glint,))), tolerance=0.05)
        audited = audit(brdfdb.open(tmp_path)["glinting"])
        assert audited.of(Energy).table.verdict == verdict
        if not resolved:
            energy = audited.of(Energy).table
            assert energy.reason.startswith("reflects at most 1 of the incident light")
            assert energy.reason.endswith("0.843 of it by glints whose power is known as an upper bound alone")
            assert energy.max_albedo == pytest.approx(1.0)
            assert energy.uncertainty is not None
            assert energy.uncertainty >= 1.0 - np.pi * GROUND - 1e-3  # down to the surface without the glint
            assert audited.of(Energy).cells()[1].word == "not judged"
            assert audited.conserves_energy.word == "not judged"

"""What is taken as printed is the printed formula: SymPy's expressions, solved by another route."""

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from drivelib import derivations as pm
from drivelib import derivations_zidani as df
from drivelib import dfim_decoupling, misprints, misprints_drive
from drivelib.dfim_drive import simulate
from drivelib.dfim_machines import DFIM_4KW
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.machines import IPMSM, SPMSM
from drivelib.speed_law import speed_command


@pytest.mark.parametrize(("omega_e", "T_e"), [(60.0, 1.0), (400.0, 3.0), (712.0, 5.06), (712.0, 0.0)])
def test_printed_slope_is_the_root_of_8_with_10_as_printed(omega_e, T_e):
    m = IPMSM
    known = {pm.R_s: m.R_s, pm.R_c: m.R_c, pm.L_d: m.L_d, pm.L_q: m.L_q, pm.lam: m.psi_f, pm.P: m.P, pm.T: T_e, pm.w: omega_e}
    slope = pm.equation("eq08").printed.subs(pm.D, pm.equation("eq10").printed).subs(pm.i_oq, pm.equation("eq09").printed)
    root = brentq(sp.lambdify(pm.i_od, slope.subs(known)), -8.0, 1.0, xtol=1e-13)
    assert_allclose(misprints.optimum_with_printed_slope(m, omega_e, T_e), root, atol=1e-10)


def test_the_root_exists_over_the_whole_operating_range():
    """The misprinted (8) rises up to the upper end of the search, for each R_c, and every root lies inside."""
    for R_c in (200.0, 1000.0):
        m = IPMSM.changed(R_c=R_c)
        found = misprints.optimum_with_printed_slope(m, np.linspace(0.1, 1, 19)[:, None] * m.omega_e_rated, np.linspace(0, m.T_rated, 7))
        assert np.isfinite(found).all() and found.max() < 0.2


def test_surface_slope_is_the_root_of_15_as_printed():
    m = SPMSM
    known = {pm.R_s: m.R_s, pm.R_c: m.R_c, pm.L_s: m.L_q, pm.lam: m.psi_f, pm.w: 400.0}
    (root,) = sp.solve(pm.equation("eq15").printed.subs(known), pm.i_od)
    assert_allclose(misprints.surface_optimum_with_printed_slope(m, 400.0), float(root), rtol=1e-12)
    with pytest.raises(ValueError, match="surface machine only"):
        misprints.surface_optimum_with_printed_slope(IPMSM, 400.0)


@pytest.mark.parametrize("printed", [True, False])
def test_rotor_voltage_and_flux_are_2_and_4(printed):
    point = df.rated_point(oriented=True)
    i_s, i_r, phi_r = (complex(*(float(point[symbol]) for symbol in pair)) for pair in ((df.i_sd, df.i_sq), (df.i_rd, df.i_rq), (df.phi_rd, df.phi_rq)))
    two, four = ((eq.printed if printed else eq.mended) for eq in (df.equation("eq02"), df.equation("eq04")))
    assert misprints.rotor_voltage(DFIM_4KW, i_r, phi_r, float(point[df.w_r]), printed=printed) == pytest.approx(complex(two.subs(point)), rel=1e-12)
    assert misprints.rotor_flux(DFIM_4KW, i_s, i_r, printed=printed) == pytest.approx(complex(four.subs(point)), rel=1e-12)


@pytest.mark.parametrize("reading", misprints_drive.READINGS)
def test_the_drive_with_printed_references_settles_at_16_as_printed(reading):
    """Currents at the end of a run are those that (16) prints for the torque command and the flux that it divides by."""
    scenario = DEFAULT_SCENARIO.changed(speed_reference=((0.0, 5.0),), load_torque=((0.0, 0.0), (0.2, 4.0)), duration=2.5)
    drive, law = misprints_drive.with_printed_references(scenario, reading)
    run = simulate(drive, law)
    share, phi = drive.T_limit / scenario.T_limit, scenario.phi_r_ref
    at = phi if reading == "reference" else run["phi_rd"][-1]
    _, i_sq, _, i_rq = dfim_decoupling.printed_current_references(run["T_ref"][-1] / share, at, scenario.machine)
    i_sd = dfim_decoupling.printed_current_references(0.0, phi, scenario.machine)[0]
    assert_allclose([run[name][-1] for name in ("i_sd", "i_sq", "i_rq")], [i_sd, i_sq, i_rq], rtol=1e-3)
    assert_allclose(run["phi_rd"][-1], scenario.machine.L_r * phi, rtol=1e-3)
    assert law.K_p / law.K_i == pytest.approx(scenario.speed_gains.K_p / scenario.speed_gains.K_i)


def test_linear_fuzzy_is_21_summed_up():
    """Sample by sample, for an error that turns; summed up it is a PI: K_u K_Δe e + K_u K_e Σe."""
    K_e, K_de, K_u = 0.01, 3.0, 0.5
    law, torque, before, errors = misprints_drive.linear_fuzzy(K_e, K_de, K_u).law(), 0.0, 0.0, 5 * np.cos(np.arange(40))
    for k, error in enumerate(errors):
        torque, _, _ = speed_command(law, error, before, 0.0, torque, 1e6, 1e-4)
        before = error
        assert torque == pytest.approx(K_u * (K_de * error + K_e * errors[: k + 1].sum()), rel=1e-7, abs=1e-7)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: misprints.optimum_with_printed_slope(IPMSM, np.nan, 1.0), "omega_e"),
        (lambda: misprints.optimum_with_printed_slope(IPMSM, 100.0, 1.0, low=1.0), "low = 1"),
        (lambda: misprints_drive.with_printed_references(DEFAULT_SCENARIO, "refrence"), "Did you mean reference"),
        (lambda: misprints_drive.linear_fuzzy(0.0, 1.0, 1.0), "K_e"),
    ],
)
def test_bad_input_is_named(call, said):
    with pytest.raises(ValueError, match=said):
        call()

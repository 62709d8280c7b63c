"""Why the drive's frame is not locked to the estimated flux: what four integrating loops do in one that is.

With L_r i_rq + M i_sq ≡ 0 both q errors are one error, so the integrators' combination u_rq + (M/L_s) u_sq
less the resistive drops is seen by no current. It is a rotor voltage along q, and turns the flux:
ω_r φ_rd = ω̂_r φ_rd + (u_rq − R_r i_rq + (M/L_s)(u_sq − R_s i_sq))/σ, ω̂_r being what the compensation assumes.
"""

import numpy as np
import pytest

from drivelib import dfim, dfim_decoupling
from drivelib.dfim_machines import DFIM_4KW
from drivelib.dfim_plant import averaged_period

M4, H, ALPHA, OMEGA_M = DFIM_4KW.changed(J=1e9), 1e-4, 1000.0, 100.0  # so heavy that the speed stays
OFFSET = 5.0  # V, added to the rotor's q integrator after it had settled


def frame_speed(seconds, measured):
    """Stator frequency (rad/s) per sample in a locked frame, and the last currents and their references."""
    c, p = dfim.coefficients(M4), M4.p
    i_sd, i_sq, i_rd, i_rq = (float(i) for i in dfim_decoupling.current_references(20.0, 0.85, M4))
    i_ref = np.array([i_sd + 1j * i_sq, i_rd + 1j * i_rq])
    R, L = np.array([M4.R_s, M4.R_r]), M4.sigma * np.array([M4.L_s, M4.L_r])
    phi = np.array(dfim.flux_linkages(*i_ref, M4))
    u = R * i_ref + np.array([0, 1j * OFFSET])
    omega_s, found = p * OMEGA_M / 2, []
    for _ in range(round(seconds / H)):
        i = np.array(dfim.currents(*phi, M4))
        used = omega_s if measured else p * OMEGA_M / 2
        terms = dfim_decoupling.compensation_terms(
            i[0].real, i[0].imag, i[1].real, i[1].imag, used, used - p * OMEGA_M, *R, M4.L_s, M4.L_r, M4.M
        )
        v_t = ALPHA * L * (i_ref - i) + u + np.array([terms[0] + 1j * terms[1], terms[2] + 1j * terms[3]])
        u = u + H * ALPHA * R * (i_ref - i)
        v_s, v_r = dfim_decoupling.inverter_voltages(*v_t, M4)
        x = averaged_period(
            phi[0].real, phi[0].imag, phi[1].real, phi[1].imag, OMEGA_M, v_s.real, v_s.imag, v_r.real, v_r.imag,
            used, 0.0, M4.R_r, H, c, 1,
        )  # fmt: skip
        phi = np.array([complex(x[0], x[1]), complex(x[2], x[3])])
        angle = np.angle(phi[1])
        phi = phi * np.exp(-1j * angle)  # the frame jumps onto the flux
        omega_s = used + angle / H
        found.append(omega_s)
    return np.array(found), i, i_ref


def test_with_the_laws_speed_an_offset_of_the_integrators_stays_as_an_error_of_frequency():
    found, i, i_ref = frame_speed(1.0, measured=False)
    assert np.abs(i - i_ref).max() < 1e-9  # the currents do not show it
    away = found - M4.p * OMEGA_M / 2
    assert away[0] == pytest.approx(OFFSET / (M4.sigma * 0.85), rel=1e-3)
    assert abs(away[-1]) > 1.0
    assert away[-1] == pytest.approx(away[len(away) // 2], rel=1e-3)


def test_with_the_speed_taken_back_from_the_flux_the_frequency_runs_away():
    found, _, _ = frame_speed(0.005, measured=True)
    away = np.abs(found - M4.p * OMEGA_M / 2)
    assert away[-1] > 10 * away[0] > 10.0

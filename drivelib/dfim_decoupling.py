"""Rotor-flux orientation and decoupling of the doubly fed induction motor (Zidani, eq. 11–17).

What is mended: (16) prints i_sd* = (L_R/M) φ*, which is a flux; with i_rd = 0, eq. (4) gives φ*/M.
(16) and (17) lack the 3/2 that (10) carries: with (10), i_sq* = 2 L_r C/(3 p M φ_rd),
i_rq* = −2 C/(3 p φ_rd) and C = −(3/2) p φ_rd i_rq. (15) drops an index in two denominators.
(13) follows from (3), (4), (6)–(9) and (12) alone; (11), which the text also cites, is not needed.
"""

from typing import NamedTuple

from drivelib.validation import array, number


def current_references(T_e, phi_r, machine):
    """Return the current references (A) for a torque at a rotor flux: eq. (16) mended, hence (11).

    Parameters
    ----------
    T_e : float or array
        Electromagnetic torque (N m).
    phi_r : float or array
        Rotor flux linkage on the d axis (Wb), positive.
    machine : DfimParameters

    Returns
    -------
    i_sd, i_sq, i_rd, i_rq : arrays, broadcast
        i_sd = φ/M, i_sq = 2 L_r C/(3 p M φ), i_rd = 0, i_rq = −(M/L_r) i_sq.

    Raises
    ------
    ValueError
        If the torque is not finite or the flux is not positive.
    """
    T_e = array("T_e", T_e, "N m")
    phi_r = array("phi_r", phi_r, "Wb", above=0)
    i_sq = 2.0 * machine.L_r * T_e / (3.0 * machine.p * machine.M * phi_r)
    i_sd = phi_r / machine.M + 0.0 * i_sq
    return i_sd, i_sq, 0.0 * i_sq, -machine.M / machine.L_r * i_sq


def printed_current_references(T_e, phi_r, machine):
    """Return what eq. (16) gives as printed: i_sd* = (L_R/M) φ*, and no 3/2. For the errata only."""
    T_e = array("T_e", T_e, "N m")
    phi_r = array("phi_r", phi_r, "Wb", above=0)
    i_sq = machine.L_r * T_e / (machine.p * machine.M * phi_r)
    return machine.L_r / machine.M * phi_r + 0.0 * i_sq, i_sq, 0.0 * i_sq, -T_e / (machine.p * phi_r)


def combined_voltages(v_s, v_r, machine):
    """Return the combined voltages v_ts = v_s − (M/L_r) v_r and v_tr = v_r − (M/L_s) v_s (V), eq. (12)."""
    return v_s - machine.M / machine.L_r * v_r, v_r - machine.M / machine.L_s * v_s


def inverter_voltages(v_ts, v_tr, machine):
    """Return the inverter voltages v_s, v_r (V) that make the combined voltages: eq. (12) inverted.

    The division by the leakage coefficient σ is what makes small changes of v_ts large ones of v_s.
    """
    sigma = machine.sigma
    return (v_ts + machine.M / machine.L_r * v_tr) / sigma, (v_tr + machine.M / machine.L_s * v_ts) / sigma


def compensation_terms(i_sd, i_sq, i_rd, i_rq, omega_s, omega_r, R_s, R_r, L_s, L_r, M):
    """Return the four compensation terms v_tsdc1, v_tsqc1, v_trdc1, v_trqc1 (V) of eq. (14), read off (13).

    Scalars or arrays; compiled inside loops and therefore unchecked. Currents in A, speeds of the
    frame seen from stator and rotor in rad/s, resistances in ohm, inductances in H. What a wrong resistance
    leaves uncompensated: ``resistance_error_voltages``.
    """
    phi_sd, phi_sq = L_s * i_sd + M * i_rd, L_s * i_sq + M * i_rq
    phi_rd, phi_rq = L_r * i_rd + M * i_sd, L_r * i_rq + M * i_sq
    k_r, k_s = M / L_r, M / L_s
    return (
        -R_r * k_r * i_rd - omega_s * phi_sq + k_r * omega_r * phi_rq,
        -R_r * k_r * i_rq + omega_s * phi_sd - k_r * omega_r * phi_rd,
        -R_s * k_s * i_sd - omega_r * phi_rq + k_s * omega_s * phi_sq,
        -R_s * k_s * i_sq + omega_r * phi_rd - k_s * omega_s * phi_sd,
    )


class OrientedPoint(NamedTuple):
    """Steady operating point under rotor-flux orientation: complex vectors (A, V, Wb), speeds (rad/s)."""

    i_s: complex
    i_r: complex
    phi_s: complex
    phi_r: complex
    v_s: complex
    v_r: complex
    omega_s: float
    omega_r: float
    T_e: float


def oriented_steady_state(omega_m, T_e, phi_r, omega_s, machine, *, v_s_limit=None, v_r_limit=None):
    """Return the steady operating point for a speed, torque and rotor flux: eq. (6)–(9), (11), (16) mended.

    Parameters
    ----------
    omega_m, T_e, phi_r : float
        Mechanical speed (rad/s), torque (N m), rotor flux linkage (Wb, positive).
    omega_s : float
        Stator frequency that the frequency law chose (rad/s); the rotor gets ω_s − p Ω.
    machine : DfimParameters
    v_s_limit, v_r_limit : float, optional
        Largest peak phase voltage of each inverter (V).

    Returns
    -------
    OrientedPoint

    Raises
    ------
    ValueError
        If an input is out of range, or a voltage limit is exceeded (naming voltage and limit).
    """
    omega_m, omega_s = number("omega_m", omega_m, "rad/s"), number("omega_s", omega_s, "rad/s")
    T_e, phi_r = number("T_e", T_e, "N m"), number("phi_r", phi_r, "Wb", above=0)
    omega_r = omega_s - machine.p * omega_m
    i_sd, i_sq, i_rd, i_rq = (float(value) for value in current_references(T_e, phi_r, machine))
    i_s, i_r = complex(i_sd, i_sq), complex(i_rd, i_rq)
    phi_s, phi_rotor = machine.L_s * i_s + machine.M * i_r, machine.L_r * i_r + machine.M * i_s
    v_s = machine.R_s * i_s + 1j * omega_s * phi_s
    v_r = machine.R_r * i_r + 1j * omega_r * phi_rotor
    for name, voltage, limit in (("v_s", v_s, v_s_limit), ("v_r", v_r, v_r_limit)):
        if limit is not None and abs(voltage) > number(f"{name}_limit", limit, "V", above=0):
            raise ValueError(
                f"{name} = {abs(voltage):.6g} V at omega_m = {omega_m:g} rad/s, T_e = {T_e:g} N m, phi_r = {phi_r:g} Wb, "
                f"omega_s = {omega_s:g} rad/s: must be at most {limit:g} V"
            )
    return OrientedPoint(i_s, i_r, phi_s, phi_rotor, v_s, v_r, omega_s, omega_r, T_e)


def torque_constant(phi_r, machine):
    """Return K_em = −(3/2) p φ_rd (N m/A) of eq. (17) mended: C_em = K_em i_rq while i_rd = 0.

    Raises
    ------
    ValueError
        If the flux is not positive.
    """
    return -1.5 * machine.p * array("phi_r", phi_r, "Wb", above=0)


def resistance_error_voltages(i_s, i_r, delta_R_s, delta_R_r, machine):
    """Return what a resistance error leaves in the compensated loops (V): disturbances of v_ts and v_tr.

    The plant's resistances are R + delta_R, the compensation knows R. Then σ L_s di_s/dt =
    v_tsc − R_s i_s + d_s with d_s = −delta_R_s i_s + (M/L_r) delta_R_r i_r, and likewise for the
    rotor: a rotor-resistance error couples both q currents, in proportion to the load.
    """
    return (
        -delta_R_s * i_s + machine.M / machine.L_r * delta_R_r * i_r,
        -delta_R_r * i_r + machine.M / machine.L_s * delta_R_s * i_s,
    )


def leakage_inductances(machine):
    """Return σ L_s and σ L_r (H), the inductances of the four compensated current loops, eq. (15)."""
    return machine.sigma * machine.L_s, machine.sigma * machine.L_r

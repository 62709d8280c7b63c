r"""Every numbered equation of both papers as LaTeX: as printed and, where it needs mending, as mended.

Each string is held against the SymPy expression that is judged (tests/test_errata.py parses it), so that the errata do
not misprint the paper. ``before`` names what an equation must follow from. Several parts of one number are several strings.
"""

from typing import NamedTuple


class Row(NamedTuple):
    """One numbered equation: key of its `symbolic.Equation`, LaTeX as printed and as mended, what it must follow from, and a remark."""

    key: str
    printed: tuple
    before: str
    mended: tuple = ()
    remark: str = ""


_TORQUE_FLUX = r"1.5P\left[\lambda+(L_{d}-L_{q})i_{od}\right]"
_IRON = r"\omega_{s}^{2}L_{d}^{2}"
_FIRST = rf"1.5P\frac{{L_{{d}}-L_{{q}}}}{{T_{{e}}}}\frac{{R_{{s}}R_{{c}}+\omega_{{s}}^{{2}}L_{{q}}^{{2}}}}{{R_{{s}}R_{{c}}+{_IRON}}}i_{{oq}}^{{3}}"

ESKANDER = (
    Row("eq01", (r"V_{q}=R_{s}i_{q}+\omega_{s}L_{d}i_{od}+\omega_{s}\lambda",), "R i + dψ/dt in the rotor's frame"),
    Row("eq02", (r"V_{d}=R_{s}i_{d}-\omega_{s}L_{q}i_{oq}",), "R i + dψ/dt in the rotor's frame"),
    Row("eq03", (r"T_{e}=1.5P\left[\lambda i_{oq}+(L_{d}-L_{q})i_{od}i_{oq}\right]",), "power in the emf branches of (1), (2), over speed"),
    Row("eq04", (r"T_{e}=T_{L}+B\omega_{r}+J\frac{d\omega_{r}}{dt}",), "kinetic energy", remark="index of the left side unreadable in our text, taken as e"),
    Row("eq05", (r"P_{cu}=R_{s}i_{d}^{2}+R_{s}i_{q}^{2}",), "(1), (2), in the frame of (3)", (r"P_{cu}=\frac{3}{2}(R_{s}i_{d}^{2}+R_{s}i_{q}^{2})",)),
    Row("eq06", (r"P_{fe}=\frac{\omega_{s}^{2}\lambda_{o}^{2}}{R_{c}}",), "circuit of fig. 1, in the frame of (3)", (r"P_{fe}=\frac{3}{2}\frac{\omega_{s}^{2}\lambda_{o}^{2}}{R_{c}}",)),
    Row("eq07", (r"P_{fe}=\frac{\omega_{s}^{2}\left[(\lambda+L_{d}i_{od})^{2}+(L_{q}i_{oq})^{2}\right]}{R_{c}}",), "(6) as printed", remark="inherits the missing 3/2"),
    Row(
        "eq08",
        (rf"\frac{{\partial P_{{L}}}}{{\partial i_{{od}}}}=2\left[i_{{od}}(R_{{s}}+\frac{{{_IRON}}}{{R_{{c}}}})+i_{{oq}}\frac{{\partial i_{{oq}}}}{{\partial i_{{od}}}}(R_{{s}}+\frac{{\omega_{{s}}^{{2}}L_{{q}}^{{2}}}}{{R_{{c}}}})+\frac{{\omega_{{s}}^{{2}}\lambda L_{{d}}}}{{R_{{c}}}}\right]",),
        "(5), (7) as printed",
    ),
    Row("eq09", (rf"i_{{oq}}=\frac{{T_{{e}}}}{{{_TORQUE_FLUX}}}",), "(3)", remark="printed on one line, T_e/1.5P[…]; all behind the stroke is meant to be below it"),
    Row(
        "eq10", (rf"\frac{{\partial i_{{oq}}}}{{\partial i_{{od}}}}=-\left[\frac{{(L_{{d}}-L_{{q}})T_{{e}}}}{{{_TORQUE_FLUX}}}\right]^{{2}}",), "(9)",
        (rf"\frac{{\partial i_{{oq}}}}{{\partial i_{{od}}}}=-\frac{{(L_{{d}}-L_{{q}})T_{{e}}}}{{{_TORQUE_FLUX}^{{2}}}}",), "(11) proves that its author used the mended form",
    ),
    Row(
        "eq11", (rf"i_{{dop}}={_FIRST}-\frac{{\lambda{_IRON}}}{{R_{{s}}R_{{c}}+{_IRON}}}",), "(8), (9), (10) mended",
        (rf"i_{{dop}}={_FIRST}-\frac{{\lambda\omega_{{s}}^{{2}}L_{{d}}}}{{R_{{s}}R_{{c}}+{_IRON}}}",), "no closed form: the right side holds i_od through (9)",
    ),
    Row("eq12", (r"V_{s}=\sqrt{V_{d}^{2}+V_{q}^{2}}",), "peak of the phase voltage"),
    Row("eq13", (r"P_{fe}=\frac{\omega_{s}^{2}\left[(\lambda+L_{s}i_{od})^{2}+(L_{s}i_{oq})^{2}\right]}{R_{c}}",), "(7) as printed", remark="inherits the missing 3/2"),
    Row("eq14", (r"T_{e}=1.5P\lambda i_{oq}",), "(3)"),
    Row(
        "eq15", (r"\frac{\partial P_{L}}{\partial i_{od}}=2\left[R_{s}i_{od}+\frac{L_{s}\omega_{s}^{2}\lambda}{R_{c}}+(\omega_{s}^{2}L_{s}^{2}i_{od})R_{c}\right]",), "(5), (13) as printed, (14)",
        (r"\frac{\partial P_{L}}{\partial i_{od}}=2\left[R_{s}i_{od}+\frac{L_{s}\omega_{s}^{2}\lambda}{R_{c}}+\frac{\omega_{s}^{2}L_{s}^{2}i_{od}}{R_{c}}\right]",), "(16) proves that its author used the mended form",
    ),
    Row("eq16", (r"i_{dop}=\frac{L_{s}\omega_{s}^{2}\lambda}{R_{s}R_{c}+\omega_{s}^{2}L_{s}^{2}}",), "(15) mended", (r"i_{dop}=-\frac{L_{s}\omega_{s}^{2}\lambda}{R_{s}R_{c}+\omega_{s}^{2}L_{s}^{2}}",)),
    Row("eq17", (r"V_{q}=R_{s}i_{oq}+\omega_{s}\lambda",), "(1)"),
    Row("eq18", (r"V_{d}=-\omega_{s}Li_{oq}",), "(2)"),
    Row("eq19", (r"T_{e}=1.5P\lambda i_{oq}",), "(3)"),
    Row("eq20", (r"\varphi_{op}=\arctan(\frac{\omega_{s}Li_{oq}}{R_{s}i_{oq}+\omega_{s}\lambda})",), "(17), (18)", remark="one bracket too many is printed"),
)  # fmt: skip

_SD, _SQ = r"R_{S}I_{Sd}+\sigma L_{S}\frac{dI_{Sd}}{dt}", r"R_{S}I_{Sq}+\sigma L_{S}\frac{dI_{Sq}}{dt}"
_RD, _RQ = r"R_{R}I_{Rd}+\sigma L_{R}\frac{dI_{Rd}}{dt}", r"R_{R}I_{Rq}+\sigma L_{R}\frac{dI_{Rq}}{dt}"
_BY_R, _BY_S = r"\frac{M_{SR}}{L_{R}}", r"\frac{M_{SR}}{L_{S}}"
_SPEED = r"{s^{2}+s\frac{1+K_{m}K_{p}}{T_{m}}+\frac{K_{m}K_{i}}{T_{m}}}"
_CLOSED = rf"\frac{{\Omega}}{{\Omega^{{*}}}}=\frac{{\frac{{K_{{m}}K_{{p}}s+K_{{m}}K_{{i}}}}{{T_{{m}}}}}}{_SPEED}"
_INTEGRALS = (r"ISE=\int_{0}^{T}e_{\Omega}^{2}dt", r"IAE=\int_{0}^{T}\lvert e_{\Omega}\rvert dt")

ZIDANI = (
    Row("eq01", (r"V_{S}=R_{S}I_{S}+\frac{d\phi_{S}}{dt}+j\omega_{S}\phi_{S}",), "R i + dφ/dt seen from the frame"),
    Row(
        "eq02", (r"V_{R}=R_{R}I_{R}+\frac{d\phi_{R}}{dt}-j\omega_{R}\phi_{R}",), "R i + dφ/dt seen from the frame, ω_R as in (8), (9), (13)",
        (r"V_{R}=R_{R}I_{R}+\frac{d\phi_{R}}{dt}+j\omega_{R}\phi_{R}",),
    ),
    Row("eq03", (r"\phi_{S}=L_{S}I_{S}+MI_{R}",), "flux linked by three windings"),
    Row("eq04", (r"\phi_{R}=L_{R}I_{R}+M_{SR}I_{R}",), "flux linked by three windings", (r"\phi_{R}=L_{R}I_{R}+M_{SR}I_{S}",)),
    Row("eq05", (r"J\frac{d\Omega}{dt}+f\Omega=C_{em}-C_{r}",), "power balance of the shaft"),
    Row("eq06", (r"V_{Sd}=R_{S}I_{Sd}+\frac{d\phi_{Sd}}{dt}-\omega_{S}\phi_{Sq}",), "(1)"),
    Row("eq07", (r"V_{Sq}=R_{S}I_{Sq}+\frac{d\phi_{Sq}}{dt}+\omega_{S}\phi_{Sd}",), "(1)"),
    Row("eq08", (r"V_{Rd}=R_{R}I_{Rd}+\frac{d\phi_{Rd}}{dt}-\omega_{R}\phi_{Rq}",), "(2) mended"),
    Row("eq09", (r"V_{Rq}=R_{R}I_{Rq}+\frac{d\phi_{Rq}}{dt}+\omega_{R}\phi_{Rd}",), "(2) mended"),
    Row("eq10", (r"C_{em}=\frac{3pM}{2L_{R}}(\phi_{Rd}I_{Sq}-\phi_{Rq}I_{Sd})",), "(6)-(9), power over speed"),
    Row("eq11", (r"I_{Rq}=-\frac{M_{SR}}{L_{R}}I_{Sq}",), "(4) mended, φ_Rq = 0", remark="I_Rd = 0, printed beside it, is a choice and no result"),
    Row("eq12", (rf"V_{{tSd}}=V_{{Sd}}-{_BY_R}V_{{Rd}}", rf"V_{{tSq}}=V_{{Sq}}-{_BY_R}V_{{Rq}}", rf"V_{{tRd}}=V_{{Rd}}-{_BY_S}V_{{Sd}}", rf"V_{{tRq}}=V_{{Rq}}-{_BY_S}V_{{Sq}}"), "no slope of the other winding's current is left"),
    Row(
        "eq13",
        (
            rf"V_{{tSd}}={_SD}-R_{{R}}{_BY_R}I_{{Rd}}-\phi_{{Sq}}\omega_{{S}}+{_BY_R}\phi_{{Rq}}\omega_{{R}}",
            rf"V_{{tSq}}={_SQ}-R_{{R}}{_BY_R}I_{{Rq}}+\phi_{{Sd}}\omega_{{S}}-{_BY_R}\phi_{{Rd}}\omega_{{R}}",
            rf"V_{{tRd}}={_RD}-R_{{S}}{_BY_S}I_{{Sd}}-\omega_{{R}}\phi_{{Rq}}+{_BY_S}\phi_{{Sq}}\omega_{{S}}",
            rf"V_{{tRq}}={_RQ}-R_{{S}}{_BY_S}I_{{Sq}}+\omega_{{R}}\phi_{{Rd}}-{_BY_S}\phi_{{Sd}}\omega_{{S}}",
        ),
        "(3), (4) mended, (6)-(9), (12)", remark="(11), which the text cites too, is not needed",
    ),
    Row("eq14", (rf"V_{{tSd}}={_SD}+V_{{tSdc1}}", rf"V_{{tSq}}={_SQ}+V_{{tSqc1}}", rf"V_{{tRd}}={_RD}+V_{{tRdc1}}", rf"V_{{tRq}}={_RQ}+V_{{tRqc1}}"), "(13)"),
    Row(
        "eq15",
        (r"\frac{I_{Sq}}{V_{tSqc}}=\frac{I_{Sd}}{V_{tSd}}=\frac{1}{R_{S}+\sigma L_{S}s}", r"\frac{I_{Rq}}{V_{tRqc}}=\frac{I_{Rd}}{V_{tRd}}=\frac{1}{R_{R}+\sigma L_{R}s}"), "(14)",
        (r"\frac{I_{Sq}}{V_{tSqc}}=\frac{I_{Sd}}{V_{tSdc}}=\frac{1}{R_{S}+\sigma L_{S}s}", r"\frac{I_{Rq}}{V_{tRqc}}=\frac{I_{Rd}}{V_{tRdc}}=\frac{1}{R_{R}+\sigma L_{R}s}"),
    ),
    Row("eq16", (r"I_{Sd}^{*}=\frac{L_{R}}{M_{SR}}\phi_{Rd}^{*}", r"I_{Rd}^{*}=0"), "(4) mended with I_Rd = 0", (r"I_{Sd}^{*}=\frac{1}{M_{SR}}\phi_{Rd}^{*}", r"I_{Rd}^{*}=0")),
    Row(
        "eq16/q", (r"I_{Sq}^{*}=\frac{L_{R}}{PM_{SR}\phi_{Rd}^{*}}C_{em}^{*}", r"I_{Rq}^{*}=-\frac{1}{P\phi_{Rd}^{*}}C_{em}^{*}"), "(10), (11)",
        (r"I_{Sq}^{*}=\frac{2L_{R}}{3PM_{SR}\phi_{Rd}^{*}}C_{em}^{*}", r"I_{Rq}^{*}=-\frac{2}{3P\phi_{Rd}^{*}}C_{em}^{*}"),
    ),
    Row("eq17", (r"C_{em}=-p\phi_{Rd}I_{Rq}",), "(10), (4) mended, I_Rd = 0", (r"C_{em}=-\frac{3}{2}p\phi_{Rd}I_{Rq}",)),
    Row("eq18", (r"J\frac{d\Omega}{dt}=K_{em}I_{Rq}-f\Omega-C_{r}",), "(5), (17) mended", remark="the text substitutes (20), which holds nothing of it; (17) is meant"),
    Row("eq19", (_CLOSED, r"K_{m}=\frac{P}{c}", r"T_{m}=\frac{J}{c}"), "(5), PI with the torque as output", (_CLOSED, r"K_{m}=\frac{1}{f}", r"T_{m}=\frac{J}{f}"), "c is defined nowhere"),
    Row("eq20", (r"K_{p}=\frac{2\xi\omega_{n}T_{m}-1}{K_{m}}", r"K_{i}=\frac{T_{m}\omega_{n}^{2}}{K_{m}}"), "denominator of (19)"),
    Row("eq21", (r"u=K_{e}e+K_{\Delta e}\Delta e",), "definition", (r"u=F(K_{e}e,K_{\Delta e}\Delta e)",), "F is the surface of table I's 49 rules; as printed there would be none"),
    Row("eq22", (r"T_{e}^{*}=K_{u}u",), "definition", remark="the prose calls u the variation of the command"),
    Row("eq23", (r"e=\Omega^{*}-\Omega",), "definition"),
    Row("eq24", (r"\Delta e=e(k)-e(k-1)",), "definition", remark="holds the sample time, which is not printed"),
    Row("eq25", (*_INTEGRALS, r"ITAE=\int_{0}^{T}\lvert e_{\Omega}\rvert dt"), "its name", (*_INTEGRALS, r"ITAE=\int_{0}^{T}t\lvert e_{\Omega}\rvert dt")),
)  # fmt: skip

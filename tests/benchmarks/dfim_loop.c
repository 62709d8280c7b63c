/* The closed DFIM drive loop in C: PI speed control, averaged inverters, one Runge-Kutta step per control period.
 *
 * The reference that drivelib.dfim_loop and drivelib.dfim_lanes are measured against, and a second implementation that
 * a test holds them to. Written from the equations of drivelib/dfim_control.py and dfim_plant.py; SI units. The same
 * source gives the loop of one drive and that of 64 abreast: element k of drive j is at index k * LANES + j.
 */
#include <math.h>

#ifndef LANES
#define LANES 64
#endif

enum { PHI_SD, PHI_SQ, PHI_RD, PHI_RQ, OMEGA_M, THETA_M, THETA_S, U_SD, U_SQ, U_RD, U_RQ, HAT_D, HAT_Q,
       MEMORY, E_PREVIOUS, T_PREVIOUS, STATES };
enum { P_R_S, P_R_R, GAMMA_S, GAMMA_R, GAMMA_M, K_T, POLES, J, F, PLANT };
enum { R_S, R_R, L_S, L_R, M, P, K_PS, K_IS, K_PR, K_IR, PHI_REF, T_LIMIT, V_S_LIMIT, V_R_LIMIT, I_S_LIMIT, I_R_LIMIT,
       LAW, OMEGA_R_CONSTANT, K_ORIENTATION, PERIOD, SETTINGS };
enum { K_P, K_I, GAINS };
enum { IAE, ISE, ITAE, INDICES };
enum { HIT_TORQUE, HIT_V_S, HIT_V_R, HIT_I_S, HIT_I_R, HITS };

typedef struct { double d, q; } vector;
typedef struct { double phi_sd, phi_sq, phi_rd, phi_rq, omega; } motion;

static inline __attribute__((always_inline)) vector turn(vector v, double c, double s) { return (vector){v.d * c + v.q * s, v.q * c - v.d * s}; }

static inline __attribute__((always_inline)) vector ahead(vector v, double x) { return turn(v, 1.0 - 0.5 * x * x, -x); }

/* cos and sin of a small angle, Taylor to 1e-16 for |x| <= 1/8 */
static inline __attribute__((always_inline)) vector cos_sin(double x)
{
    double z = x * x;
    return (vector){1.0 + z * (-1.0 / 2 + z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800))))),
                    x + x * z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800)))))};
}

static inline __attribute__((always_inline)) vector clipped(vector v, double limit)
{
    double squared = v.d * v.d + v.q * v.q;
    double scale = squared <= limit * limit ? 1.0 : limit / sqrt(squared);
    return (vector){v.d * scale, v.q * scale};
}

static inline __attribute__((always_inline)) double at_limit(double value, double limit) { return value > limit ? limit : value < -limit ? -limit : value; }

/* Eq. (5)-(10) */
static inline __attribute__((always_inline)) motion derivative(motion x, vector v_s, vector v_r, double omega_s, double load, double R_r,
                                const double *restrict p, int n)
{
    double i_sd = p[GAMMA_S * n] * x.phi_sd - p[GAMMA_M * n] * x.phi_rd;
    double i_sq = p[GAMMA_S * n] * x.phi_sq - p[GAMMA_M * n] * x.phi_rq;
    double i_rd = p[GAMMA_R * n] * x.phi_rd - p[GAMMA_M * n] * x.phi_sd;
    double i_rq = p[GAMMA_R * n] * x.phi_rq - p[GAMMA_M * n] * x.phi_sq;
    double omega_r = omega_s - p[POLES * n] * x.omega;
    double torque = p[K_T * n] * (x.phi_rd * i_sq - x.phi_rq * i_sd);
    return (motion){v_s.d - p[P_R_S * n] * i_sd + omega_s * x.phi_sq, v_s.q - p[P_R_S * n] * i_sq - omega_s * x.phi_sd,
                    v_r.d - R_r * i_rd + omega_r * x.phi_rq, v_r.q - R_r * i_rq - omega_r * x.phi_rd,
                    (torque - load - p[F * n] * x.omega) / p[J * n]};
}

static inline __attribute__((always_inline)) motion moved(motion x, double h, motion v)
{
    return (motion){x.phi_sd + h * v.phi_sd, x.phi_sq + h * v.phi_sq, x.phi_rd + h * v.phi_rd, x.phi_rq + h * v.phi_rq,
                    x.omega + h * v.omega};
}

/* One control period of one drive; n is the distance from one element to the next */
static inline __attribute__((always_inline)) void period(double *restrict state, const double *restrict p, const double *restrict s,
                          const double *restrict gain, const double *restrict profile, double *restrict index,
                          double *restrict hit, int n, int k, int from, int to)
{
    double omega_ref = profile[0], load = profile[n], R_r = p[P_R_R * n] * profile[2 * n], h = s[PERIOD * n];
    motion x = {state[PHI_SD * n], state[PHI_SQ * n], state[PHI_RD * n], state[PHI_RQ * n], state[OMEGA_M * n]};

    /* Currents, flux, frame speed */
    double i_sd = p[GAMMA_S * n] * x.phi_sd - p[GAMMA_M * n] * x.phi_rd;
    double i_sq = p[GAMMA_S * n] * x.phi_sq - p[GAMMA_M * n] * x.phi_rq;
    double i_rd = p[GAMMA_R * n] * x.phi_rd - p[GAMMA_M * n] * x.phi_sd;
    double i_rq = p[GAMMA_R * n] * x.phi_rq - p[GAMMA_M * n] * x.phi_sq;
    double phi_sd = s[L_S * n] * i_sd + s[M * n] * i_rd, phi_sq = s[L_S * n] * i_sq + s[M * n] * i_rq;
    double phi_rd = s[L_R * n] * i_rd + s[M * n] * i_sd, phi_rq = s[L_R * n] * i_rq + s[M * n] * i_sq;
    double floor_ = 0.2 * s[PHI_REF * n], usable = phi_rd > floor_ ? phi_rd : floor_;
    double omega_e = s[P * n] * x.omega;
    double law = s[LAW * n] == 0.0 ? 0.5 * omega_e : omega_e + s[OMEGA_R_CONSTANT * n];
    double omega_s = law + s[K_ORIENTATION * n] * phi_rq / usable, omega_r = omega_s - omega_e;

    /* Speed controller and current references */
    double e = omega_ref - x.omega, memory = state[MEMORY * n];
    double asked = gain[K_P * n] * e + memory, torque = at_limit(asked, s[T_LIMIT * n]);
    memory += h * (gain[K_I * n] * e + gain[K_I * n] / gain[K_P * n] * (torque - asked));
    double k_r = s[M * n] / s[L_R * n], k_s = s[M * n] / s[L_S * n];
    double sigma = 1.0 - s[M * n] * s[M * n] / (s[L_S * n] * s[L_R * n]);
    double i_q = 2.0 * s[L_R * n] / (3.0 * s[P * n] * s[M * n]) * torque / usable;
    double e_sd = s[PHI_REF * n] / s[M * n] - i_sd, e_sq = i_q - i_sq, e_rd = -i_rd, e_rq = -k_r * i_q - i_rq;

    /* Current controllers, compensation, inverters */
    double t_sd = s[K_PS * n] * e_sd + state[U_SD * n] - s[R_R * n] * k_r * i_rd - omega_s * phi_sq + k_r * omega_r * phi_rq;
    double t_sq = s[K_PS * n] * e_sq + state[U_SQ * n] - s[R_R * n] * k_r * i_rq + omega_s * phi_sd - k_r * omega_r * phi_rd;
    double t_rd = s[K_PR * n] * e_rd + state[U_RD * n] - s[R_S * n] * k_s * i_sd - omega_r * phi_rq + k_s * omega_s * phi_sq;
    double t_rq = s[K_PR * n] * e_rq + state[U_RQ * n] - s[R_S * n] * k_s * i_sq + omega_r * phi_rd - k_s * omega_s * phi_sd;
    vector w_s = {(t_sd + k_r * t_rd) / sigma, (t_sq + k_r * t_rq) / sigma}, v_s = clipped(w_s, s[V_S_LIMIT * n]);
    vector w_r = {(t_rd + k_s * t_sd) / sigma, (t_rq + k_s * t_sq) / sigma}, v_r = clipped(w_r, s[V_R_LIMIT * n]);
    double a_s = s[K_IS * n] / s[K_PS * n], a_r = s[K_IR * n] / s[K_PR * n];
    state[U_SD * n] += h * (s[K_IS * n] * e_sd + a_s * (v_s.d - k_r * v_r.d - t_sd));
    state[U_SQ * n] += h * (s[K_IS * n] * e_sq + a_s * (v_s.q - k_r * v_r.q - t_sq));
    state[U_RD * n] += h * (s[K_IR * n] * e_rd + a_r * (v_r.d - k_s * v_s.d - t_rd));
    state[U_RQ * n] += h * (s[K_IR * n] * e_rq + a_r * (v_r.q - k_s * v_s.q - t_rq));
    double i_s2 = i_sd * i_sd + i_sq * i_sq, i_r2 = i_rd * i_rd + i_rq * i_rq;
    hit[HIT_TORQUE * n] = (hit[HIT_TORQUE * n] < 0) & (torque != asked) ? k : hit[HIT_TORQUE * n];
    hit[HIT_V_S * n] = (hit[HIT_V_S * n] < 0) & ((v_s.d != w_s.d) | (v_s.q != w_s.q)) ? k : hit[HIT_V_S * n];
    hit[HIT_V_R * n] = (hit[HIT_V_R * n] < 0) & ((v_r.d != w_r.d) | (v_r.q != w_r.q)) ? k : hit[HIT_V_R * n];
    hit[HIT_I_S * n] = (hit[HIT_I_S * n] < 0) & (i_s2 > s[I_S_LIMIT * n] * s[I_S_LIMIT * n]) ? k : hit[HIT_I_S * n];
    hit[HIT_I_R * n] = (hit[HIT_I_R * n] < 0) & (i_r2 > s[I_R_LIMIT * n] * s[I_R_LIMIT * n]) ? k : hit[HIT_I_R * n];

    /* Runge-Kutta; stator voltage held in the stator's frame, rotor voltage in the rotor's */
    double half = 0.5 * h, poles = p[POLES * n];
    vector t_s = cos_sin(half * omega_s), t_r = cos_sin(half * (omega_s - poles * x.omega));
    motion a = derivative(x, turn(v_s, t_s.d, -t_s.q), turn(v_r, t_r.d, -t_r.q), omega_s, load, R_r, p, n);
    motion b = derivative(moved(x, half, a), v_s, v_r, omega_s, load, R_r, p, n);
    double b_angle = half * a.omega;
    motion c = derivative(moved(x, half, b), v_s, ahead(v_r, poles * half * b_angle), omega_s, load, R_r, p, n);
    double c_angle = half * b.omega;
    vector end_r = ahead(turn(v_r, t_r.d, t_r.q), poles * h * c_angle);
    motion d = derivative(moved(x, h, c), turn(v_s, t_s.d, t_s.q), end_r, omega_s, load, R_r, p, n);
    double sixth = h / 6.0, gained = sixth * (2.0 * (b_angle + c_angle) + h * c.omega);
    state[PHI_SD * n] = x.phi_sd + sixth * (a.phi_sd + 2.0 * (b.phi_sd + c.phi_sd) + d.phi_sd);
    state[PHI_SQ * n] = x.phi_sq + sixth * (a.phi_sq + 2.0 * (b.phi_sq + c.phi_sq) + d.phi_sq);
    state[PHI_RD * n] = x.phi_rd + sixth * (a.phi_rd + 2.0 * (b.phi_rd + c.phi_rd) + d.phi_rd);
    state[PHI_RQ * n] = x.phi_rq + sixth * (a.phi_rq + 2.0 * (b.phi_rq + c.phi_rq) + d.phi_rq);
    state[OMEGA_M * n] = x.omega + sixth * (a.omega + 2.0 * (b.omega + c.omega) + d.omega);
    state[THETA_M * n] += h * x.omega + gained;
    state[THETA_S * n] += h * omega_s;
    state[HAT_D * n] = phi_rd, state[HAT_Q * n] = phi_rq;
    state[MEMORY * n] = memory, state[E_PREVIOUS * n] = e, state[T_PREVIOUS * n] = torque;

    /* Error indices, the error straight within the period */
    double counts = (k >= from) & (k < to) ? 1.0 : 0.0, e1 = omega_ref - state[OMEGA_M * n];
    double a0 = fabs(e), a1 = fabs(e1), t = (k - from) * h, crosses = e * e1 < 0.0 ? 1.0 : 0.0;
    double first = h * a0 / (a0 + a1 + (1.0 - crosses)), rest = h - first;
    double iae = (1.0 - crosses) * 0.5 * h * (a0 + a1) + crosses * 0.5 * (first * a0 + rest * a1);
    double broken = a0 * first * first / 6.0 + a1 * rest * (0.5 * first + rest / 3.0);
    double moment = (1.0 - crosses) * (h * h * (a0 + 2.0 * a1) / 6.0) + crosses * broken;
    index[IAE * n] += counts * iae;
    index[ISE * n] += counts * (h * (e * e + e * e1 + e1 * e1) / 3.0);
    index[ITAE * n] += counts * (t * iae + moment);
}

/* One drive. changes: samples at which the next row of profiles (reference, load, factor on R_r) begins. */
void run_one(int steps, double *state, const double *plant, const double *settings, const double *gains,
             const int *changes, const double *profiles, int from, int to, double *index, double *hit)
{
    int row = -1;
    for (int k = 0; k < steps; k++) {
        while (changes[row + 1] <= k)
            row++;
        period(state, plant, settings, gains, profiles + 3 * row, index, hit, 1, k, from, to);
    }
}

/* LANES drives abreast, changing profiles at the same samples; profiles[row][3][LANES]. */
void run_many(int steps, double *restrict state, const double *restrict plant, const double *restrict settings,
              const double *restrict gains, const int *restrict changes, const double *restrict profiles, int from, int to,
              double *restrict index, double *restrict hit)
{
    int row = -1;
    for (int k = 0; k < steps; k++) {
        while (changes[row + 1] <= k)
            row++;
        const double *now = profiles + 3 * LANES * row;
#pragma omp simd
        for (int j = 0; j < LANES; j++)
            period(state + j, plant + j, settings + j, gains + j, now + j, index + j, hit + j, LANES, k, from, to);
    }
}

#include "gbt_gp_likelihood.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define R GBT_ROWS_OF_WINDOW
#define ROW GBT_ROW_BEGIN
#define P GBT_TUNABLE
#define SLOPES GBT_SLOPES
#define EVALUATIONS 40                             /* most expansions of the likelihood in one search */
#define LONGEST_STEP ((gbt_real)2)                 /* largest change of a logarithm in one step */
#define SMALLEST_FALL ((gbt_real)0.02)             /* of the gradient, over what was expected, that tells of curvature */
#define GAIN ((gbt_real)1e-5)                      /* expected gain below which a search stops */
#ifdef GBT_SINGLE
#define ROUNDING ((gbt_real)5e-14) /* times 1/nugget, a gain that shows in no forecast; the likelihood rounds at 7e-15 */
#define LEAST_LOG_NUGGET ((gbt_real)-30.6) /* 5e-14, about the rounding of a covariance in gbt_wide */
#else
#define ROUNDING ((gbt_real)2.2e-16)
#define LEAST_LOG_NUGGET (-GBT_INFINITY)
#endif
#define LOG_TWO_PI ((gbt_real)1.8378770664093453)

/* Value, gradient and Fisher information of likelihood times priors. */
typedef struct {
    gbt_real value, gradient[P], information[P][P];
} expansion;

/* The lower bound of a parameter: below the least nugget, rounding of the covariance is taken for motion. */
static gbt_real low_of(const gbt_tuning *tuning, int p)
{
    return GBT_TUNED_NUGGET && p == P - 1 ? gbt_fmax(tuning->low[p], LEAST_LOG_NUGGET) : tuning->low[p];
}

static gbt_real nugget_of(const gbt_tuning *tuning, const gbt_real *log_theta)
{
    return GBT_TUNED_NUGGET ? gbt_exp(log_theta[P - 1]) : tuning->nugget;
}

/* The lag between two rows, and the prior covariance of their directions at one time. */
static gbt_wide lag_of(const gbt_gp_rows *rows, int i, int j)
{
    return gbt_plus(rows->time[i], gbt_negative(rows->time[j]));
}

static gbt_wide gram_of(const gbt_gp_rows *rows, int i, int j, gbt_real variance)
{
    gbt_wide sum = gbt_widen(0);
    for (int k = 0; k < GBT_DIMENSION; k++)
        sum = gbt_more(sum, gbt_widen(rows->direction[i][k]), gbt_widen(rows->direction[j][k]));
    return gbt_times(gbt_widen(variance), sum);
}

void gbt_gp_covariance(const gbt_gp_rows *rows, const gbt_real *log_theta, gbt_real nugget, gbt_wide omega[GBT_PACKED],
                       gbt_wide slopes[GBT_SHAPES][GBT_PACKED])
{
    const gbt_real variance = gbt_exp(2 * log_theta[GBT_SHAPES]);
    const gbt_gp_shape shape = gbt_gp_shape_of(log_theta);
    for (int i = 0; i < rows->rows; i++) {
        gbt_wide k = gbt_widen(0), along[GBT_SHAPES] = {gbt_widen(0)};
        for (int j = 0; j <= i; j++) {
            const gbt_wide gram = gram_of(rows, i, j, variance);
            /* rows of one time have one lag */
            if (j == 0 || gbt_narrow(lag_of(rows, j, j - 1)) != 0)
                k = gbt_gp_kernel(lag_of(rows, i, j), &shape, slopes ? along : 0);
            omega[ROW(i) + j] = gbt_times(gram, k);
            for (int s = 0; slopes && s < GBT_SHAPES; s++) slopes[s][ROW(i) + j] = gbt_times(gram, along[s]);
        }
        omega[ROW(i) + i] = gbt_plus(omega[ROW(i) + i], gbt_widen(variance * nugget + rows->variance[i]));
    }
}

void gbt_gp_whiten(const gbt_gp_rows *rows, const gbt_wide *factor, gbt_wide *whitened)
{
    for (int i = 0; i < rows->rows; i++) {
        const gbt_wide *row = factor + ROW(i);
        gbt_wide rest = gbt_widen(rows->value[i]);
        for (int k = 0; k < i; k++) rest = gbt_gather_less(rest, row[k], whitened[k]);
        whitened[i] = gbt_times(gbt_gathered(rest), row[i]);
    }
}

/* L^-1 V L^-T of the rows' own variances V, which the last GBT_DIMENSION rows have: the triangle of these rows. */
static void whiten_variances(const gbt_wide *inverse, const gbt_gp_rows *rows, gbt_wide *a)
{
    const int first = rows->rows - GBT_DIMENSION;
    for (int i = first; i < rows->rows; i++)
        for (int j = first; j <= i; j++) {
            gbt_wide sum = gbt_widen(0);
            for (int k = first; k <= j; k++)
                sum = gbt_more(sum, inverse[ROW(i) + k], gbt_times(gbt_widen(rows->variance[k]), inverse[ROW(j) + k]));
            a[ROW(i - first) + j - first] = sum;
        }
}

/* How log theta turns what is expanded (shapes, nugget, own variances, the logarithm of a factor on all): the amplitude
   scales all of the covariance but the rows' own variances. */
static gbt_real turn_of(int parameter, int expanded)
{
    if (parameter < GBT_SHAPES) return parameter == expanded;
    if (parameter == GBT_SHAPES) return expanded == SLOPES ? 2 : expanded == SLOPES - 1 ? -2 : 0;
    return expanded == GBT_SHAPES;
}

/* How many deviations a parameter is above its prior median; 0 where it has no prior. */
static gbt_real excess_of(const gbt_tuning *tuning, const gbt_real *log_theta, int p)
{
    return tuning->spread[p] > 0 ? (log_theta[p] - tuning->median[p]) / tuning->spread[p] : 0;
}

static gbt_real prior_of(const gbt_tuning *tuning, const gbt_real *log_theta)
{
    gbt_real value = 0;
    for (int p = 0; p < P; p++) value -= excess_of(tuning, log_theta, p) * excess_of(tuning, log_theta, p) / 2;
    return value;
}

/* Returns 0 where the covariance has no Cholesky factor, and where likelihood times priors is not above what is asked for:
   nothing more is then computed than that. */
static int expand(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, const gbt_real *log_theta,
                  gbt_real least, expansion *out)
{
    enum { Q = SLOPES + 1 };
    gbt_wide *inverse = work->inverse, whitened[R];
    gbt_real square = 0, gradient[Q], information[Q][Q];
    gbt_block slope[SLOPES];
    const int n = rows->rows;
    const gbt_real nugget = nugget_of(tuning, log_theta), noise = gbt_exp(2 * log_theta[GBT_SHAPES]) * nugget;
    gbt_gp_covariance(rows, log_theta, nugget, inverse, work->slope);
    if (!gbt_factor(inverse, n)) return 0;
    gbt_gp_whiten(rows, inverse, whitened);
    out->value = prior_of(tuning, log_theta) - (gbt_real)0.5 * (gbt_real)n * LOG_TWO_PI;
    for (int i = 0; i < n; i++) {
        square += gbt_narrow(whitened[i]) * gbt_narrow(whitened[i]);
        out->value += gbt_log(gbt_narrow(inverse[ROW(i) + i]));
    }
    out->value -= square / 2;
    if (!(out->value > least)) return 0;
    gbt_invert_factor(inverse, n);
    for (int s = 0; s < SLOPES - 1; s++) {
        if (s < GBT_SHAPES)
            gbt_whiten_symmetric(inverse, n, work->slope[s]);
        else
            gbt_whiten_identity(inverse, n, noise, work->slope[s]);
        slope[s] = (gbt_block){work->slope[s], 0, n};
    }
    slope[SLOPES - 1] = (gbt_block){work->own, n - GBT_DIMENSION, rows->noisy ? GBT_DIMENSION : 0};
    if (rows->noisy) whiten_variances(inverse, rows, work->own);
    for (int s = 0; s < SLOPES; s++) {
        const gbt_real trace = gbt_trace(slope[s]);
        gradient[s] = (gbt_form_of(slope[s], whitened) - trace) / 2;
        information[s][Q - 1] = information[Q - 1][s] = trace / 2;
        for (int q = 0; q <= s; q++) information[s][q] = information[q][s] = gbt_trace_of_product(slope[s], slope[q]) / 2;
    }
    gradient[Q - 1] = (square - (gbt_real)n) / 2;
    information[Q - 1][Q - 1] = (gbt_real)n / 2;
    for (int p = 0; p < P; p++) {
        out->gradient[p] = 0;
        for (int a = 0; a < Q; a++) out->gradient[p] += turn_of(p, a) * gradient[a];
        for (int q = 0; q < P; q++) {
            out->information[p][q] = 0;
            for (int a = 0; a < Q; a++)
                for (int b = 0; b < Q; b++) out->information[p][q] += turn_of(p, a) * information[a][b] * turn_of(q, b);
        }
        if (!(tuning->spread[p] > 0)) continue;
        out->gradient[p] -= excess_of(tuning, log_theta, p) / tuning->spread[p];
        out->information[p][p] += 1 / (tuning->spread[p] * tuning->spread[p]);
    }
    return 1;
}

/* The damped step of the free parameters, as far as a quadratic in the logarithms can be trusted; zero in the others.
   Returns the gain that is expected of it. */
static gbt_real scoring_step(gbt_real information[P][P], const gbt_real *gradient, const int *free, gbt_real damping,
                             gbt_real *step)
{
    gbt_real curvature[P * P], found[P], largest = 0, longest = 0, gain = 0;
    int count = 0, place[P] = {0};
    for (int p = 0; p < P; p++)
        if (free[p]) place[count++] = p;
    for (int a = 0; a < count; a++) {
        found[a] = gradient[place[a]];
        for (int b = 0; b < count; b++) {
            const gbt_real entry = curvature[a * count + b] = information[place[a]][place[b]];
            if ((a == 0 && b == 0) || entry > largest) largest = entry;
        }
    }
    for (int a = 0; a < count; a++) curvature[a * (count + 1)] += damping + (gbt_real)1e-9 * (1 + largest);
    if (!gbt_solve_square(curvature, count, found, 1))
        for (int a = 0; a < count; a++) found[a] = 0;
    for (int p = 0; p < P; p++) step[p] = 0;
    for (int a = 0; a < count; a++) longest = gbt_fmax(longest, gbt_fabs(found[a]));
    for (int a = 0; a < count; a++) {
        step[place[a]] = longest <= LONGEST_STEP ? found[a] : found[a] * (LONGEST_STEP / longest);
        gain += gradient[place[a]] * step[place[a]];
    }
    return gain;
}

/* What to add to the Fisher information for it to explain how the gradient fell along the last step: the update of
   Broyden, Fletcher, Goldfarb and Shanno. Zero where the gradient did not fall. */
static void correct(gbt_real correction[P][P], gbt_real information[P][P], const gbt_real *step, const gbt_real *fall)
{
    gbt_real expected[P], known = 0, found = 0;
    for (int p = 0; p < P; p++) {
        expected[p] = 0;
        for (int q = 0; q < P; q++) expected[p] += (information[p][q] + correction[p][q]) * step[q];
    }
    for (int p = 0; p < P; p++) {
        known += step[p] * expected[p];
        found += step[p] * fall[p];
    }
    const int fell = found > SMALLEST_FALL * known && SMALLEST_FALL * known > 0;
    for (int p = 0; p < P; p++)
        for (int q = 0; q < P; q++)
            correction[p][q] =
                fell ? correction[p][q] + fall[p] * (fall[q] / found) - expected[p] * (expected[q] / known) : 0;
}

/* The log theta that maximises likelihood times priors within bounds, from a start, by Fisher scoring, as long as the
   logarithm of the nugget is above the least of interest. Returns what the likelihood times priors is there. */
static gbt_real maximise(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, gbt_real least_log_nugget,
                         gbt_real *theta)
{
    expansion here, there;
    gbt_real damping = 0, correction[P][P] = {{0}}, sum[P][P], step[P], trial[P], fall[P];
    for (int p = 0; p < P; p++) theta[p] = gbt_fmin(gbt_fmax(theta[p], low_of(tuning, p)), tuning->high[p]);
    if (!expand(tuning, rows, work, theta, -GBT_INFINITY, &here)) return -GBT_INFINITY;
    for (int k = 0; k < EVALUATIONS; k++) {
        int free[P], some = 0;
        gbt_real steepest = 0;
        const gbt_real nugget = nugget_of(tuning, theta), gain = GAIN + ROUNDING / nugget;
        for (int p = 0; p < P; p++) {
            /* what the gradient would push through its bound stays there */
            free[p] = tuning->high[p] > low_of(tuning, p) && (theta[p] > low_of(tuning, p) || here.gradient[p] > 0) &&
                      (theta[p] < tuning->high[p] || here.gradient[p] < 0);
            some = some || free[p];
            if (free[p]) steepest = gbt_fmax(steepest, here.information[p][p]);
            for (int q = 0; q < P; q++) sum[p][q] = here.information[p][q] + correction[p][q];
        }
        if (!some || (GBT_TUNED_NUGGET && theta[P - 1] < least_log_nugget)) break;
        /* the Fisher information has the last word: a correction from few steps may be wrong elsewhere */
        if (scoring_step(sum, here.gradient, free, damping, step) < gain &&
            scoring_step(here.information, here.gradient, free, damping, step) < gain)
            break;
        for (int p = 0; p < P; p++) trial[p] = gbt_fmin(gbt_fmax(theta[p] + step[p], low_of(tuning, p)), tuning->high[p]);
        if (expand(tuning, rows, work, trial, here.value, &there)) {
            for (int p = 0; p < P; p++) {
                step[p] = trial[p] - theta[p];
                fall[p] = here.gradient[p] - there.gradient[p];
                theta[p] = trial[p];
            }
            correct(correction, there.information, step, fall);
            damping = damping > (gbt_real)1e-3 ? damping / 4 : 0;
            here = there;
        } else {
            for (int p = 0; p < P; p++)
                for (int q = 0; q < P; q++) correction[p][q] = 0;
            damping = gbt_fmax(4 * damping, (gbt_real)0.3 * steepest);
        }
    }
    return here.value;
}

void gbt_gp_tune(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, gbt_real *log_theta)
{
    gbt_real smooth[P];
    int some = 0;
    for (int p = 0; p < P; p++) some = some || tuning->high[p] > low_of(tuning, p);
    if (!some) return;
    const gbt_real found = maximise(tuning, rows, work, -GBT_INFINITY, log_theta);
    if (!GBT_TUNED_NUGGET || log_theta[0] > tuning->suspect || log_theta[P - 1] < tuning->telltale) return;
    /* Noise can be taken for a motion that jitters, and no local search leaves that: try the other start too. */
    for (int p = 0; p < P; p++) smooth[p] = tuning->smooth[p];
    if (!(maximise(tuning, rows, work, tuning->exact, smooth) > found)) return;
    for (int p = 0; p < P; p++) log_theta[p] = smooth[p];
}

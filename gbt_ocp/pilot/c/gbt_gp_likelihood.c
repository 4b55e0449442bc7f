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
#define LEAST_LOG_NUGGET ((gbt_real)-30.6) /* 5e-14, about the rounding of a covariance in gbt_wide */
#else
#define LEAST_LOG_NUGGET (-GBT_INFINITY)
#endif
#define LOG_TWO_PI ((gbt_real)1.8378770664093453)

/* Value, gradient and Fisher information of likelihood times priors. */
typedef struct {
    gbt_real value, gradient[P], information[P][P];
} expansion;

int gbt_factor(gbt_wide *lower, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            gbt_wide rest = lower[ROW(i) + j];
            for (int k = 0; k < j; k++) rest = gbt_less(rest, lower[ROW(i) + k], lower[ROW(j) + k]);
            if (j == i && !(gbt_narrow(rest) > 0 && isfinite(gbt_narrow(rest)))) return 0;
            lower[ROW(i) + j] = j == i ? gbt_root(rest) : gbt_over(rest, lower[ROW(j) + j]);
        }
    return 1;
}

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
    for (int i = 0; i < rows->rows; i++) {
        for (int j = 0; j <= i; j++) {
            gbt_wide along[GBT_SHAPES];
            const gbt_wide gram = gram_of(rows, i, j, variance);
            omega[ROW(i) + j] = gbt_times(gram, gbt_gp_kernel(lag_of(rows, i, j), log_theta, slopes ? along : 0));
            for (int s = 0; slopes && s < GBT_SHAPES; s++) slopes[s][ROW(i) + j] = gbt_times(gram, along[s]);
        }
        omega[ROW(i) + i] = gbt_plus(omega[ROW(i) + i], gbt_widen(variance * nugget + rows->variance[i]));
    }
}

/* The inverse of a lower factor, in its place: an entry is read for the last time where its own is written. */
static void invert_lower(gbt_wide *lower, int n)
{
    for (int j = 0; j < n; j++)
        for (int i = j; i < n; i++) {
            gbt_wide rest = gbt_widen(i == j);
            for (int k = j; k < i; k++) rest = gbt_less(rest, lower[ROW(i) + k], lower[ROW(k) + j]);
            lower[ROW(i) + j] = gbt_over(rest, lower[ROW(i) + i]);
        }
}

/* a = L^-1 a L^-T, symmetric, in its place: the last row first, which needs none after it. */
static void whiten(const gbt_wide *inverse, int n, gbt_wide *a)
{
    gbt_wide half[R];
    for (int i = n - 1; i >= 0; i--) {
        for (int j = 0; j <= i; j++) {
            half[j] = gbt_widen(0);
            for (int k = 0; k <= i; k++)
                half[j] = gbt_more(half[j], inverse[ROW(i) + k], a[k >= j ? ROW(k) + j : ROW(j) + k]);
        }
        for (int j = 0; j <= i; j++) {
            gbt_wide sum = gbt_widen(0);
            for (int k = 0; k <= j; k++) sum = gbt_more(sum, half[k], inverse[ROW(j) + k]);
            a[ROW(i) + j] = sum;
        }
    }
}

/* The same of a diagonal: of one number, or of the rows' own variances. */
static void whiten_diagonal(const gbt_wide *inverse, int n, const gbt_real *diagonal, int step, gbt_wide *a)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            gbt_wide sum = gbt_widen(0);
            for (int k = 0; k <= j; k++)
                if (diagonal[k * step] > 0)
                    sum = gbt_more(sum, inverse[ROW(i) + k], gbt_times(gbt_widen(diagonal[k * step]), inverse[ROW(j) + k]));
            a[ROW(i) + j] = sum;
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

/* 0 where the covariance has no Cholesky factor. */
static int expand(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, const gbt_real *log_theta,
                  expansion *out)
{
    enum { Q = SLOPES + 1 };
    gbt_wide *inverse = work->inverse, (*slope)[GBT_PACKED] = work->slope;
    gbt_real whitened[R], gradient[Q], information[Q][Q];
    const int n = rows->rows;
    const gbt_real nugget = nugget_of(tuning, log_theta), noise = gbt_exp(2 * log_theta[GBT_SHAPES]) * nugget;
    gbt_real square = 0;
    gbt_gp_covariance(rows, log_theta, nugget, inverse, slope);
    if (!gbt_factor(inverse, n)) return 0;
    invert_lower(inverse, n);
    out->value = (gbt_real)-0.5 * (gbt_real)n * LOG_TWO_PI;
    for (int i = 0; i < n; i++) {
        gbt_wide sum = gbt_widen(0);
        for (int k = 0; k <= i; k++) sum = gbt_more(sum, inverse[ROW(i) + k], gbt_widen(rows->value[k]));
        whitened[i] = gbt_narrow(sum);
        square += whitened[i] * whitened[i];
        out->value += gbt_log(gbt_narrow(inverse[ROW(i) + i]));
    }
    out->value -= square / 2;
    for (int s = 0; s < SLOPES; s++) {
        gbt_real along = 0, trace = 0;
        if (s < GBT_SHAPES)
            whiten(inverse, n, slope[s]);
        else if (s < SLOPES - 1)
            whiten_diagonal(inverse, n, &noise, 0, slope[s]);
        else
            whiten_diagonal(inverse, n, rows->variance, 1, slope[s]);
        for (int i = 0; i < n; i++) {
            trace += gbt_narrow(slope[s][ROW(i) + i]);
            for (int j = 0; j <= i; j++)
                along += (i == j ? 1 : 2) * whitened[i] * gbt_narrow(slope[s][ROW(i) + j]) * whitened[j];
        }
        gradient[s] = (along - trace) / 2;
        information[s][Q - 1] = information[Q - 1][s] = trace / 2;
        for (int q = 0; q <= s; q++) {
            gbt_real sum = 0;
            for (int i = 0; i < n; i++)
                for (int j = 0; j <= i; j++)
                    sum += (i == j ? 1 : 2) * gbt_narrow(slope[s][ROW(i) + j]) * gbt_narrow(slope[q][ROW(i) + j]);
            information[s][q] = information[q][s] = sum / 2;
        }
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
        const gbt_real excess = (log_theta[p] - tuning->median[p]) / tuning->spread[p];
        out->value -= excess * excess / 2;
        out->gradient[p] -= excess / tuning->spread[p];
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

/* The log theta that maximises likelihood times priors within bounds, from a start, by Fisher scoring. */
static void maximise(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, gbt_real *theta)
{
    expansion here, there;
    gbt_real damping = 0, correction[P][P] = {{0}}, sum[P][P], step[P], trial[P], fall[P];
    for (int p = 0; p < P; p++) theta[p] = gbt_fmin(gbt_fmax(theta[p], low_of(tuning, p)), tuning->high[p]);
    if (!expand(tuning, rows, work, theta, &here)) return;
    for (int k = 0; k < EVALUATIONS; k++) {
        int free[P], some = 0;
        gbt_real steepest = 0;
        for (int p = 0; p < P; p++) {
            /* what the gradient would push through its bound stays there */
            free[p] = tuning->high[p] > low_of(tuning, p) && (theta[p] > low_of(tuning, p) || here.gradient[p] > 0) &&
                      (theta[p] < tuning->high[p] || here.gradient[p] < 0);
            some = some || free[p];
            if (free[p]) steepest = gbt_fmax(steepest, here.information[p][p]);
            for (int q = 0; q < P; q++) sum[p][q] = here.information[p][q] + correction[p][q];
        }
        if (!some) return;
        /* the Fisher information has the last word: a correction from few steps may be wrong elsewhere */
        if (scoring_step(sum, here.gradient, free, damping, step) < GAIN &&
            scoring_step(here.information, here.gradient, free, damping, step) < GAIN)
            return;
        for (int p = 0; p < P; p++) trial[p] = gbt_fmin(gbt_fmax(theta[p] + step[p], low_of(tuning, p)), tuning->high[p]);
        if (expand(tuning, rows, work, trial, &there) && there.value > here.value) {
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
}

void gbt_gp_tune(const gbt_tuning *tuning, const gbt_gp_rows *rows, gbt_gp_tuning_work *work, gbt_real *log_theta)
{
    gbt_real smooth[P];
    expansion here, there;
    int some = 0;
    for (int p = 0; p < P; p++) some = some || tuning->high[p] > low_of(tuning, p);
    if (!some) return;
    maximise(tuning, rows, work, log_theta);
    if (!GBT_TUNED_NUGGET || log_theta[0] > tuning->suspect) return;
    /* Noise can be taken for a motion that jitters, and no local search leaves that: try the other start too. */
    for (int p = 0; p < P; p++) smooth[p] = tuning->smooth[p];
    maximise(tuning, rows, work, smooth);
    if (!expand(tuning, rows, work, smooth, &there)) return;
    if (expand(tuning, rows, work, log_theta, &here) && here.value >= there.value) return;
    for (int p = 0; p < P; p++) log_theta[p] = smooth[p];
}

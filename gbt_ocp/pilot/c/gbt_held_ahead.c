#include "gbt_held_ahead.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_BANK_STATE
#define AT GBT_HELD_AT
#define HALF_STEP ((gbt_real)GBT_AHEAD_STEP / 2)

void gbt_fading_begin(const gbt_held_prior *prior, int nodes, gbt_fading *fading)
{
    for (int k = 0; k < nodes; k++) {
        const gbt_real time = (gbt_real)(GBT_AHEAD_STEP * k);
        fading->left[k] = gbt_exp(-time / prior->hold);
        fading->kept[k] = gbt_exp(-time / prior->speed_time);
        fading->turned[k] = k > 0 ? fading->turned[k - 1] + HALF_STEP * (fading->left[k - 1] + fading->left[k]) : 0;
        fading->drawn[k] = HALF_STEP + fading->turned[k]; /* it rises to a draw over the step before it */
    }
}

/* Variances of the draws at so many nodes that make up those of a value there, which stand in their place: of a value that
   keeps a share of itself from node to node. */
static void draws_of(gbt_real *variance, int nodes, gbt_real keep)
{
    for (int k = nodes - 1; k > 0; k--) variance[k] = gbt_fmax(variance[k] - keep * keep * variance[k - 1], 0);
}

/* The same for a value that is held: its mean square now, and the variance when it is drawn. */
static void held_draws(const gbt_real *left, int nodes, gbt_real present, gbt_real drawn, gbt_real *draw)
{
    for (int k = 0; k < nodes; k++) draw[k] = (1 - left[k]) * (drawn + present * left[k]);
    draws_of(draw, nodes, left[1]);
}

static gbt_real mean_square(const gbt_component *one, int at) { return one->mean[at] * one->mean[at] + one->covariance[AT(at, at)]; }

/* Velocity at the means of course and speed at a node. */
static void velocity_at(const gbt_fading *fading, const gbt_component *one, int node, gbt_real *rate)
{
    const gbt_real *m = one->mean, course = m[GBT_AT_COURSE] + m[GBT_AT_TURN] * fading->turned[node];
    const gbt_real faster = m[GBT_AT_LEVEL] + m[GBT_AT_CHANGE] * fading->kept[node];
    const gbt_real speed = gbt_exp(gbt_fmin(faster, GBT_LARGEST_LOG_SPEED));
    rate[0] = speed * gbt_cos(course);
    rate[1] = speed * gbt_sin(course);
}

/* Mean and covariance at a node. */
static void moments_at(const gbt_ahead *ahead, const gbt_fading *fading, const gbt_component *one, int node,
                       gbt_real *mean, gbt_real *covariance)
{
    gbt_real slopes[D][N], half[N];
    for (int i = 0; i < D; i++) {
        mean[i] = ahead->start[i];
        for (int j = 0; j < N; j++) slopes[i][j] = 0;
        for (int a = 0; a < D; a++) slopes[i][gbt_polar_at[a]] = ahead->polar[i][a];
    }
    for (int i = 0; i < 2; i++) {
        mean[i] += ahead->way[i];
        slopes[i][GBT_AT_COURSE] = ahead->sideways[0][i];
        slopes[i][GBT_AT_TURN] = ahead->sideways[1][i];
        slopes[i][GBT_AT_LEVEL] = ahead->onwards[0][i];
        slopes[i][GBT_AT_CHANGE] = ahead->onwards[1][i];
    }
#if GBT_DIMENSION == 3
    mean[2] += one->mean[GBT_AT_CLIMB] * fading->turned[node];
    slopes[2][GBT_AT_CLIMB] = fading->turned[node];
#else
    (void)fading;
#endif
    for (int i = 0; i < D; i++) {
        for (int b = 0; b < N; b++) {
            half[b] = 0;
            for (int a = 0; a < N; a++) half[b] += slopes[i][a] * one->covariance[AT(a, b)];
        }
        for (int j = 0; j <= i; j++) {
            gbt_real sum = 0;
            for (int b = 0; b < N; b++) sum += half[b] * slopes[j][b];
            for (int k = 1; j < 2 && i < 2 && k <= node; k++) {
                sum += ahead->turn_draw[k] * ahead->sideways[1 + k][i] * ahead->sideways[1 + k][j];
                sum += ahead->speed_draw[k] * ahead->onwards[1 + k][i] * ahead->onwards[1 + k][j];
            }
#if GBT_DIMENSION == 3
            for (int k = 1; j == 2 && k <= node; k++)
                sum += ahead->climb_draw[k] * fading->drawn[node - k] * fading->drawn[node - k];
#endif
            covariance[i * D + j] = covariance[j * D + i] = sum;
        }
    }
}

void gbt_ahead_begin(gbt_ahead *ahead, const gbt_held_prior *prior, const gbt_fading *fading, int nodes,
                     const gbt_component *one, gbt_real *mean, gbt_real *covariance)
{
    const gbt_real turn = gbt_turn_std(prior, one->branch), speed = gbt_speed_std(prior, one->branch);
    gbt_bank_position(one, ahead->start, ahead->polar);
    held_draws(fading->left, nodes, mean_square(one, GBT_AT_TURN), turn * turn, ahead->turn_draw);
    for (int k = 0; k < nodes; k++) ahead->speed_draw[k] = speed * speed * (1 - fading->kept[k] * fading->kept[k]);
    draws_of(ahead->speed_draw, nodes, fading->kept[1]);
#if GBT_DIMENSION == 3
    held_draws(fading->left, nodes, mean_square(one, GBT_AT_CLIMB), prior->climb_std * prior->climb_std, ahead->climb_draw);
#endif
    for (int i = 0; i < 2; i++) {
        ahead->way[i] = 0;
        for (int c = 0; c < 1 + nodes; c++) ahead->sideways[c][i] = ahead->onwards[c][i] = 0;
    }
    velocity_at(fading, one, 0, ahead->rate);
    moments_at(ahead, fading, one, 0, mean, covariance);
}

/* Adds a trapezoid to an integral over the velocity, or across it, of a factor before and now. */
static void add(gbt_real *integral, const gbt_real *before, gbt_real factor_before, const gbt_real *now, gbt_real factor)
{
    for (int i = 0; i < 2; i++) integral[i] += HALF_STEP * (before[i] * factor_before + now[i] * factor);
}

void gbt_ahead_next(gbt_ahead *ahead, const gbt_fading *fading, const gbt_component *one, int node, gbt_real *mean,
                    gbt_real *covariance)
{
    const gbt_real along_before[2] = {ahead->rate[0], ahead->rate[1]}, across_before[2] = {-ahead->rate[1], ahead->rate[0]};
    gbt_real *along = ahead->rate;
    velocity_at(fading, one, node, along);
    const gbt_real across[2] = {-along[1], along[0]};
    add(ahead->way, along_before, 1, along, 1);
    add(ahead->sideways[0], across_before, 1, across, 1);
    add(ahead->sideways[1], across_before, fading->turned[node - 1], across, fading->turned[node]);
    add(ahead->onwards[0], along_before, 1, along, 1);
    add(ahead->onwards[1], along_before, fading->kept[node - 1], along, fading->kept[node]);
    for (int k = 1; k <= node; k++) { /* a draw at node k */
        const int since = node - k;
        const gbt_real turned = since > 0 ? fading->drawn[since - 1] : 0, kept = since > 0 ? fading->kept[since - 1] : 0;
        add(ahead->sideways[1 + k], across_before, turned, across, fading->drawn[since]);
        add(ahead->onwards[1 + k], along_before, kept, along, fading->kept[since]);
    }
    moments_at(ahead, fading, one, node, mean, covariance);
}

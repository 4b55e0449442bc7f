#include "gbt_held_bank.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_BANK_STATE
#define AT GBT_HELD_AT
#define HALF_TURN (GBT_TURN / 2)
#define NEAREST_SQUARED ((gbt_real)1) /* square of the range below which a component tells no directions apart, m^2 */
#define LEAST_COSINE ((gbt_real)0.05) /* of an elevation: straight above the vehicle there is no azimuth */

const int gbt_polar_at[3] = {GBT_AT_AZIMUTH, GBT_AT_LOG_RANGE, GBT_AT_ELEVATION};

gbt_real gbt_wrapped(gbt_real angle)
{
    const gbt_real turned = gbt_fmod(angle + HALF_TURN, GBT_TURN);
    return (turned < 0 ? turned + GBT_TURN : turned) - HALF_TURN;
}

gbt_real gbt_turn_std(const gbt_held_prior *prior, int branch) { return prior->turn_std[branch / GBT_SPEED_STDS]; }
gbt_real gbt_speed_std(const gbt_held_prior *prior, int branch) { return prior->speed_std[branch % GBT_SPEED_STDS]; }

/* ---- positions ---- */

void gbt_bank_position(const gbt_component *one, gbt_real *place, gbt_real slopes[D][D])
{
    const gbt_real *m = one->mean, r = gbt_exp(m[GBT_AT_LOG_RANGE]);
    const gbt_real cosine = gbt_cos(m[GBT_AT_AZIMUTH]), sine = gbt_sin(m[GBT_AT_AZIMUTH]);
#if GBT_DIMENSION == 2
    const gbt_real level = r;
#else
    const gbt_real level = r * gbt_cos(m[GBT_AT_ELEVATION]), up = r * gbt_sin(m[GBT_AT_ELEVATION]);
    place[2] = up;
    slopes[2][0] = 0;
    slopes[0][2] = -up * cosine;
    slopes[1][2] = -up * sine;
    slopes[2][2] = level;
#endif
    place[0] = level * cosine;
    place[1] = level * sine;
    slopes[0][0] = -level * sine;
    slopes[1][0] = level * cosine;
    for (int i = 0; i < D; i++) slopes[i][1] = place[i];
}

void gbt_bank_spread(const gbt_component *one, gbt_real slopes[D][D], gbt_real *covariance)
{
    gbt_real half[D][D];
    for (int i = 0; i < D; i++)
        for (int b = 0; b < D; b++) {
            half[i][b] = 0;
            for (int a = 0; a < D; a++) half[i][b] += slopes[i][a] * one->covariance[AT(gbt_polar_at[a], gbt_polar_at[b])];
        }
    for (int i = 0; i < D; i++)
        for (int j = 0; j <= i; j++) {
            gbt_real sum = 0;
            for (int b = 0; b < D; b++) sum += half[i][b] * slopes[j][b];
            covariance[i * D + j] = covariance[j * D + i] = sum;
        }
}

/* ---- starts ---- */

/* Number k of a grid within so many standard deviations, evenly spaced; opposite ones are exactly opposite, so that rounding
   does not make one likelier than the other. */
static gbt_real normal_grid(int k, int count, gbt_real most)
{
    return count > 1 ? most * ((gbt_real)(2 * k - count + 1) / (gbt_real)(count - 1)) : -most;
}

/* Variance of the Gaussians on such a grid that make up a standard one. */
static gbt_real remainder_of(int count, gbt_real most)
{
    gbt_real total = 0, squares = 0;
    for (int k = 0; k < count; k++) {
        const gbt_real at = normal_grid(k, count, most), weight = gbt_exp(at * at / -2);
        total += weight;
        squares += weight * at * at;
    }
    return gbt_fmax(1 - squares / total, (gbt_real)0.05);
}

void gbt_bank_start(const gbt_held_prior *prior, const gbt_real *angles, gbt_real variance, const int *grid, int k,
                    gbt_component *one)
{
    const gbt_real farthest = 2, fastest = 1;
    const int branch = k % GBT_TURN_STDS * GBT_SPEED_STDS, course = k / GBT_TURN_STDS % grid[2];
    const int level = k / GBT_TURN_STDS / grid[2] % grid[1], range = k / GBT_TURN_STDS / grid[2] / grid[1];
    const gbt_real z = normal_grid(range, grid[0], farthest), y = normal_grid(level, grid[1], fastest);
    const gbt_real wide = (gbt_real)0.6 * GBT_TURN / (gbt_real)grid[2];
    for (int i = 0; i < N; i++) one->mean[i] = 0;
    for (int i = 0; i < GBT_ROW_BEGIN(N); i++) one->covariance[i] = 0;
    one->log_weight = (z * z + y * y) / -2;
    one->branch = branch;
    one->mean[GBT_AT_AZIMUTH] = angles[0];
    one->mean[GBT_AT_LOG_RANGE] = gbt_log(prior->range) + prior->log_range_std * z;
    /* between the borders of the cells in which turn rates are drawn again: rounding would decide on them */
    one->mean[GBT_AT_COURSE] = ((gbt_real)course + (gbt_real)0.5) * GBT_TURN / (gbt_real)grid[2] - HALF_TURN;
    one->mean[GBT_AT_LEVEL] = gbt_log(prior->speed) + prior->log_speed_std * y;
    one->covariance[AT(GBT_AT_AZIMUTH, GBT_AT_AZIMUTH)] = variance;
    one->covariance[AT(GBT_AT_LOG_RANGE, GBT_AT_LOG_RANGE)] =
        prior->log_range_std * prior->log_range_std * remainder_of(grid[0], farthest);
    one->covariance[AT(GBT_AT_COURSE, GBT_AT_COURSE)] = wide * wide;
    one->covariance[AT(GBT_AT_TURN, GBT_AT_TURN)] = gbt_turn_std(prior, branch) * gbt_turn_std(prior, branch);
    one->covariance[AT(GBT_AT_LEVEL, GBT_AT_LEVEL)] =
        prior->log_speed_std * prior->log_speed_std * remainder_of(grid[1], fastest);
    one->covariance[AT(GBT_AT_CHANGE, GBT_AT_CHANGE)] = gbt_speed_std(prior, branch) * gbt_speed_std(prior, branch);
#if GBT_DIMENSION == 3
    const gbt_real cosine = gbt_fmax(gbt_cos(angles[1]), LEAST_COSINE);
    one->mean[GBT_AT_ELEVATION] = angles[1];
    one->covariance[AT(GBT_AT_AZIMUTH, GBT_AT_AZIMUTH)] /= cosine * cosine;
    one->covariance[AT(GBT_AT_ELEVATION, GBT_AT_ELEVATION)] = variance;
    one->covariance[AT(GBT_AT_CLIMB, GBT_AT_CLIMB)] = prior->climb_std * prior->climb_std;
#endif
#if GBT_SIZED
    one->mean[GBT_AT_SIZE] = prior->log_size;
    one->covariance[AT(GBT_AT_SIZE, GBT_AT_SIZE)] = prior->log_size_std * prior->log_size_std;
#endif
}

/* ---- steps ---- */

/* The covariance after a step in which course, turn rate, level, change, vertical speed and size go on by themselves, and the
   rows of azimuth, log range and elevation are given. */
static void carry(gbt_component *one, gbt_real rows[D][N], gbt_real step, gbt_real keep)
{
    gbt_real half[N][N];
    for (int j = 0; j < N; j++) {
        for (int a = 0; a < D; a++) {
            gbt_real sum = 0;
            for (int k = 0; k < N; k++) sum += rows[a][k] * one->covariance[AT(k, j)];
            half[gbt_polar_at[a]][j] = sum;
        }
        half[GBT_AT_COURSE][j] = one->covariance[AT(GBT_AT_COURSE, j)] + step * one->covariance[AT(GBT_AT_TURN, j)];
        half[GBT_AT_TURN][j] = one->covariance[AT(GBT_AT_TURN, j)];
        half[GBT_AT_LEVEL][j] = one->covariance[AT(GBT_AT_LEVEL, j)];
        half[GBT_AT_CHANGE][j] = keep * one->covariance[AT(GBT_AT_CHANGE, j)];
#if GBT_DIMENSION == 3
        half[GBT_AT_CLIMB][j] = one->covariance[AT(GBT_AT_CLIMB, j)];
#endif
#if GBT_SIZED
        half[GBT_AT_SIZE][j] = one->covariance[AT(GBT_AT_SIZE, j)];
#endif
    }
    for (int i = 0; i < N; i++) {
        for (int a = 0; a < D; a++) {
            gbt_real sum = 0;
            if (gbt_polar_at[a] > i) continue;
            for (int k = 0; k < N; k++) sum += half[i][k] * rows[a][k];
            one->covariance[AT(i, gbt_polar_at[a])] = sum;
        }
        if (i >= GBT_AT_COURSE)
            one->covariance[AT(i, GBT_AT_COURSE)] = half[i][GBT_AT_COURSE] + step * half[i][GBT_AT_TURN];
        if (i >= GBT_AT_TURN) one->covariance[AT(i, GBT_AT_TURN)] = half[i][GBT_AT_TURN];
        if (i >= GBT_AT_LEVEL) one->covariance[AT(i, GBT_AT_LEVEL)] = half[i][GBT_AT_LEVEL];
        if (i >= GBT_AT_CHANGE) one->covariance[AT(i, GBT_AT_CHANGE)] = keep * half[i][GBT_AT_CHANGE];
#if GBT_DIMENSION == 3
        if (i >= GBT_AT_CLIMB) one->covariance[AT(i, GBT_AT_CLIMB)] = half[i][GBT_AT_CLIMB];
#endif
    }
}

void gbt_bank_move(const gbt_component *one, gbt_real step, const gbt_real *moved, gbt_real *place, gbt_real slopes[D][N])
{
    const gbt_real *m = one->mean, course = m[GBT_AT_COURSE] + step / 2 * m[GBT_AT_TURN];
    const gbt_real way = step * gbt_exp(gbt_fmin(m[GBT_AT_LEVEL] + m[GBT_AT_CHANGE], GBT_LARGEST_LOG_SPEED));
    const gbt_real cosine = way * gbt_cos(course), sine = way * gbt_sin(course);
    gbt_real polar[D][D];
    gbt_bank_position(one, place, polar);
    for (int i = 0; i < D; i++) {
        place[i] -= moved[i];
        for (int j = 0; j < N; j++) slopes[i][j] = 0;
        for (int a = 0; a < D; a++) slopes[i][gbt_polar_at[a]] = polar[i][a];
    }
    place[0] += cosine;
    place[1] += sine;
    slopes[0][GBT_AT_COURSE] = -sine;
    slopes[1][GBT_AT_COURSE] = cosine;
    slopes[0][GBT_AT_LEVEL] = slopes[0][GBT_AT_CHANGE] = cosine;
    slopes[1][GBT_AT_LEVEL] = slopes[1][GBT_AT_CHANGE] = sine;
    for (int i = 0; i < 2; i++) slopes[i][GBT_AT_TURN] = step / 2 * slopes[i][GBT_AT_COURSE];
#if GBT_DIMENSION == 3
    place[2] += step * m[GBT_AT_CLIMB];
    slopes[2][GBT_AT_CLIMB] = step;
#endif
}

void gbt_bank_advance(const gbt_held_prior *prior, gbt_component *one, gbt_real step, const gbt_real *moved)
{
    gbt_real *m = one->mean, place[D], slopes[D][N], rows[D][N];
    const gbt_real keep = gbt_exp(-gbt_fabs(step) / prior->speed_time), std = gbt_speed_std(prior, one->branch);
    gbt_bank_move(one, step, moved, place, slopes);
    const gbt_real level = gbt_fmax(place[0] * place[0] + place[1] * place[1], LEAST_COSINE * LEAST_COSINE * NEAREST_SQUARED);
    const gbt_real square = gbt_fmax(gbt_dot(place, place), NEAREST_SQUARED);
    for (int j = 0; j < N; j++) {
        rows[0][j] = (place[0] * slopes[1][j] - place[1] * slopes[0][j]) / level;
        rows[1][j] = 0;
        for (int i = 0; i < D; i++) rows[1][j] += place[i] * slopes[i][j];
        rows[1][j] /= square;
    }
#if GBT_DIMENSION == 3
    const gbt_real flat = gbt_sqrt(level);
    for (int j = 0; j < N; j++) {
        const gbt_real along = (place[0] * slopes[0][j] + place[1] * slopes[1][j]) / flat;
        rows[2][j] = (flat * slopes[2][j] - place[2] * along) / square;
    }
    m[GBT_AT_ELEVATION] = gbt_atan2(place[2], flat);
#endif
    carry(one, rows, step, keep);
    one->covariance[AT(GBT_AT_CHANGE, GBT_AT_CHANGE)] += std * std * (1 - keep * keep);
    m[GBT_AT_AZIMUTH] += gbt_wrapped(gbt_atan2(place[1], place[0]) - m[GBT_AT_AZIMUTH]);
    m[GBT_AT_LOG_RANGE] = gbt_log(square) / 2;
    m[GBT_AT_COURSE] = gbt_wrapped(m[GBT_AT_COURSE] + step * m[GBT_AT_TURN]);
    m[GBT_AT_CHANGE] *= keep;
}

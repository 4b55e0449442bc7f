#include "gbt_held_correct.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_BANK_STATE
#define AT GBT_HELD_AT
#define LEAST_COSINE ((gbt_real)0.05) /* of an elevation: straight above the vehicle there is no azimuth */
#define LEAST ((gbt_real)1e-30) /* of what a square root is taken of */

/* Conditions a component on so many rows that are off by `off`: `cross` is the covariance of its numbers with them, `spread`
   their own. Returns the squared standardised innovation. */
static gbt_real condition(gbt_component *one, int rows, gbt_real cross[N][D], gbt_real spread[D][D], const gbt_real *off,
                          gbt_real *log_determinant)
{
    /* by the Cholesky factor of the spread, l: half = cross l^-T, so that the covariance loses half half' */
    gbt_real l[D][D] = {{0}}, whitened[D], half[N][D], square = 0;
    *log_determinant = 0;
    for (int r = 0; r < rows; r++) {
        for (int c = 0; c <= r; c++) {
            gbt_real rest = spread[r][c];
            for (int k = 0; k < c; k++) rest -= l[r][k] * l[c][k];
            l[r][c] = c == r ? gbt_sqrt(gbt_fmax(rest, LEAST)) : rest / l[c][c];
        }
        whitened[r] = off[r];
        for (int k = 0; k < r; k++) whitened[r] -= l[r][k] * whitened[k];
        whitened[r] /= l[r][r];
        square += whitened[r] * whitened[r];
        *log_determinant += 2 * gbt_log(l[r][r]);
    }
    for (int i = 0; i < N; i++)
        for (int r = 0; r < rows; r++) {
            half[i][r] = cross[i][r];
            for (int k = 0; k < r; k++) half[i][r] -= l[r][k] * half[i][k];
            half[i][r] /= l[r][r];
            one->mean[i] += half[i][r] * whitened[r];
        }
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++)
            for (int r = 0; r < rows; r++) one->covariance[AT(i, j)] -= half[i][r] * half[j][r];
    return square;
}

gbt_real gbt_bank_correct(gbt_component *one, const gbt_real *angles, gbt_real variance)
{
    static const int seen[2] = {GBT_AT_AZIMUTH, GBT_AT_ELEVATION};
    gbt_real cross[N][D], spread[D][D], off[D], log_determinant, cosine = 1;
#if GBT_DIMENSION == 3
    cosine = gbt_fmax(gbt_cos(one->mean[GBT_AT_ELEVATION]), LEAST_COSINE);
#endif
    off[0] = gbt_wrapped(angles[0] - one->mean[GBT_AT_AZIMUTH]);
    for (int a = 0; a < GBT_AXES; a++) {
        if (a > 0) off[a] = angles[a] - one->mean[seen[a]];
        for (int i = 0; i < N; i++) cross[i][a] = one->covariance[AT(i, seen[a])];
        for (int b = 0; b < GBT_AXES; b++) spread[a][b] = cross[seen[b]][a];
        spread[a][a] += a == 0 ? variance / (cosine * cosine) : variance;
    }
    const gbt_real square = condition(one, GBT_AXES, cross, spread, off, &log_determinant);
    one->log_weight -= (square + log_determinant + GBT_AXES * gbt_log(GBT_TURN)) / 2;
    return square;
}

void gbt_bank_place(gbt_component *one, const gbt_real *position, const gbt_real *covariance)
{
    gbt_real place[D], slopes[D][D], cross[N][D], spread[D][D], off[D], log_determinant;
    gbt_bank_position(one, place, slopes);
    gbt_bank_spread(one, slopes, spread[0]);
    for (int r = 0; r < D; r++) {
        off[r] = position[r] - place[r];
        for (int c = 0; c < D; c++) spread[r][c] += covariance[r * D + c];
        for (int i = 0; i < N; i++) {
            cross[i][r] = 0;
            for (int a = 0; a < D; a++) cross[i][r] += one->covariance[AT(i, gbt_polar_at[a])] * slopes[r][a];
        }
    }
    const gbt_real square = condition(one, D, cross, spread, off, &log_determinant);
    one->log_weight -= (square + log_determinant) / 2;
}

void gbt_bank_sight(gbt_component *one, const gbt_sighting *sighting, gbt_real lag, const gbt_real *origin,
                    gbt_real bearing_std)
{
    static const gbt_real still[D];
    gbt_real position[D], slopes[D][N], observation[D][N], cross[N][D], spread[D][D], off[D], log_determinant;
    gbt_polar_rows rows;
    gbt_bank_move(one, lag, still, position, slopes);
    for (int i = 0; i < D; i++) position[i] += origin[i];
    gbt_polar_of(sighting, position, bearing_std, GBT_SIZED ? one->mean[N - 1] : 0, &rows);
    for (int r = 0; r < rows.rows; r++) {
        off[r] = rows.residuals[r] / rows.std[r];
        for (int j = 0; j < N; j++) {
            observation[r][j] = 0;
            for (int i = 0; i < D; i++)
                observation[r][j] += (rows.across[r][i] + rows.along[r] * rows.unit[i]) * slopes[i][j];
            observation[r][j] /= rows.range * rows.std[r];
        }
        if (GBT_SIZED) observation[r][N - 1] += rows.size[r] / rows.std[r];
        for (int i = 0; i < N; i++) {
            cross[i][r] = 0;
            for (int j = 0; j < N; j++) cross[i][r] += one->covariance[AT(i, j)] * observation[r][j];
        }
    }
    for (int r = 0; r < rows.rows; r++)
        for (int c = 0; c < rows.rows; c++) {
            spread[r][c] = r == c;
            for (int j = 0; j < N; j++) spread[r][c] += observation[r][j] * cross[j][c];
        }
    const gbt_real square = condition(one, rows.rows, cross, spread, off, &log_determinant);
    one->log_weight -= (square + log_determinant) / 2;
}

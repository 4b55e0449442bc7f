#include "gbt_kalman.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define N GBT_N
#define COLUMNS (N + 1)

int gbt_kalman_update(gbt_real mean[N], gbt_real covariance[N][N], int rows, gbt_real observation[GBT_MOST_ROWS][N],
                      const gbt_real *std, const gbt_real *innovation, gbt_real *log_likelihood)
{
    /* a column more than the state has numbers, for the innovation */
    gbt_real cross[GBT_MOST_ROWS * COLUMNS], spread[GBT_MOST_ROWS * GBT_MOST_ROWS], kept[N][N], root[N * N], half[N][N];
    gbt_real density = (gbt_real)rows * gbt_log(GBT_TURN);
    for (int r = 0; r < rows; r++) {
        for (int j = 0; j < N; j++) {
            cross[r * COLUMNS + j] = 0;
            for (int k = 0; k < N; k++) cross[r * COLUMNS + j] += observation[r][k] * covariance[k][j];
        }
        cross[r * COLUMNS + N] = innovation[r];
    }
    for (int r = 0; r < rows; r++)
        for (int q = 0; q < rows; q++) {
            spread[r * rows + q] = r == q ? std[r] * std[r] : 0;
            for (int k = 0; k < N; k++) spread[r * rows + q] += cross[r * COLUMNS + k] * observation[q][k];
        }
    gbt_symmetric(spread, rows);
    /* the gain, transposed, takes the place of the cross covariance */
    if (!gbt_solve_square(spread, rows, cross, COLUMNS)) return 0;
    for (int r = 0; r < rows; r++)
        density += innovation[r] * cross[r * COLUMNS + N] + gbt_log(gbt_fabs(spread[r * (rows + 1)]));
    if (log_likelihood) *log_likelihood = -density / 2;
    gbt_covariance_root(&covariance[0][0], N, root);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            kept[i][j] = i == j;
            for (int r = 0; r < rows; r++) kept[i][j] -= cross[r * COLUMNS + i] * observation[r][j];
        }
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            half[i][j] = 0;
            for (int k = 0; k < N; k++) half[i][j] += kept[i][k] * root[k * N + j];
        }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            covariance[i][j] = 0;
            for (int k = 0; k < N; k++) covariance[i][j] += half[i][k] * half[j][k];
            for (int r = 0; r < rows; r++) covariance[i][j] += cross[r * COLUMNS + i] * std[r] * std[r] * cross[r * COLUMNS + j];
        }
        for (int r = 0; r < rows; r++) mean[i] += cross[r * COLUMNS + i] * innovation[r];
    }
    gbt_symmetric(&covariance[0][0], N);
    return 1;
}

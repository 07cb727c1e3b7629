#pragma once

#include <cstddef>

namespace tunnel_pilot::neural {

/// Losses of a run of outputs against its targets: each returns E, the sum over the run, and writes
/// dE/dy. A run may be one sample's outputs, or some lanes of a row of BatchPass (outputGradient() of
/// lanes that hold no sample must be zero: that is the caller's).
using Loss = double (*)(const double* outputs, const double* targets, std::size_t count,
                        double* gradient);

/// E = sum (y - t)^2 / 2, dE/dy = y - t.
double halfSquaredError(const double* outputs, const double* targets, std::size_t count,
                        double* gradient);

/// For sigmoid outputs and targets that are probabilities (soft ones, too):
/// E = sum t log(t / y) + (1 - t) log((1 - t) / (1 - y)), dE/dy = (y - t) / (y (1 - y)).
/// That is the cross-entropy less the targets' own entropy, so that E is 0 for perfect outputs. The
/// derivative by the sum under the sigmoid is y - t (Bishop 1995, section 6.7). Outputs are held 1e-12
/// away from 0 and 1. Outputs outside of [0, 1] give a loss that is not a number.
double crossEntropy(const double* outputs, const double* targets, std::size_t count, double* gradient);

}  // namespace tunnel_pilot::neural

// Momentum, conjugate gradients and Levenberg-Marquardt on problems whose answers are known.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "tunnel_pilot/neural/conjugate_gradient.h"
#include "tunnel_pilot/neural/delay_line.h"
#include "tunnel_pilot/neural/diverged.h"
#include "tunnel_pilot/neural/early_stopping.h"
#include "tunnel_pilot/neural/levenberg_marquardt.h"
#include "tunnel_pilot/neural/momentum.h"
#include "tunnel_pilot/neural/objective.h"

namespace tunnel_pilot::neural {
namespace {

// f = (1 - a)^2 + 100 (b - a^2)^2, with its minimum 0 at (1, 1).
double rosenbrock(const std::vector<double>& p, std::vector<double>* gradient) {
  const double u = 1.0 - p[0];
  const double v = p[1] - p[0] * p[0];
  if (gradient != nullptr) *gradient = {-2.0 * u - 400.0 * p[0] * v, 200.0 * v};
  return u * u + 100.0 * v * v;
}

// A long valley: half of sum k_i (p_i - i)^2 with k from 1 to 1000.
double valley(const std::vector<double>& p, std::vector<double>* gradient) {
  if (gradient != nullptr) gradient->resize(p.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double k = std::pow(1000.0, static_cast<double>(i) / static_cast<double>(p.size() - 1));
    const double d = p[i] - static_cast<double>(i);
    if (gradient != nullptr) (*gradient)[i] = k * d;
    sum += 0.5 * k * d * d;
  }
  return sum;
}

Samples xorSamples() { return {{0, 0, 0, 1, 1, 0, 1, 1}, {0, 1, 1, 0}}; }

Samples sineSamples() {
  Samples samples;
  for (int i = 0; i < 60; ++i) {
    const double x = -1.0 + i / 29.5;
    samples.inputs.push_back(x);
    samples.targets.push_back(std::sin(3.0 * x));
  }
  return samples;
}

Network made(std::vector<Layer> layers, std::uint64_t seed) {
  Network network(std::move(layers));
  network.randomise(seed);
  return network;
}

Network xorNetwork() {
  return made({Layer::dense(2, 4, Activation::kTanh), Layer::dense(4, 1, Activation::kSigmoid)}, 3);
}

Network sineNetwork() {
  return made({Layer::dense(1, 8, Activation::kTanh), Layer::dense(8, 1, Activation::kLinear)}, 3);
}

void expectXor(Network& network) {
  BatchPass pass(network);
  const Samples samples = xorSamples();
  for (std::size_t l = 0; l < 4; ++l) {
    pass.input(0)[l] = samples.inputs[2 * l];
    pass.input(1)[l] = samples.inputs[2 * l + 1];
  }
  pass.forward();
  for (std::size_t l = 0; l < 4; ++l) EXPECT_NEAR(pass.output(0)[l], samples.targets[l], 0.1) << l;
}

// --- momentum

TEST(Momentum, StepsFollowTheFormula) {
  Momentum momentum(1, {0.1, 0.5});
  std::vector<double> p = {1.0};
  momentum.step(p, {2.0});
  EXPECT_DOUBLE_EQ(p[0], 1.0 - 0.2);
  momentum.step(p, {2.0});
  EXPECT_DOUBLE_EQ(p[0], 0.8 - 0.1 - 0.2);
  momentum.step(p, {0.0}, 0.5);
  EXPECT_DOUBLE_EQ(p[0], 0.5 - 0.15);
}

TEST(Momentum, LearnsXor) {
  Network network = xorNetwork();
  const Samples samples = xorSamples();
  NetworkObjective objective(network, samples, crossEntropy);
  Momentum momentum(network.parameters().size(), {0.3, 0.9});
  std::vector<double> p = network.parameters();
  std::vector<double> gradient;
  std::vector<double> curve;
  for (int epoch = 0; epoch < 1000; ++epoch) {
    const double error = objective(p, &gradient);
    if (epoch == 0 || epoch == 100 || epoch == 300 || epoch == 999) curve.push_back(error);
    momentum.step(p, gradient);
  }
  for (std::size_t i = 1; i < curve.size(); ++i) EXPECT_LT(curve[i], curve[i - 1]) << i;
  EXPECT_LT(curve.back(), 0.01);
  expectXor(network);
}

TEST(Momentum, IsQuickerInAValleyThanPlainDescent) {
  const auto descend = [](double share) {
    Momentum momentum(10, {1e-3, share});
    std::vector<double> p(10, 0.0);
    std::vector<double> gradient;
    for (int i = 0; i < 500; ++i) {
      valley(p, &gradient);
      momentum.step(p, gradient);
    }
    return valley(p, nullptr);
  };
  EXPECT_LT(descend(0.9), 0.01 * descend(0.0));
}

TEST(Momentum, DivergenceIsSaidAndLeavesTheParameters) {
  Momentum momentum(1, {1.0, 0.9});  // far too quick for a slope of 1000
  std::vector<double> p = {1.0};
  std::vector<double> before;
  const auto run = [&] {
    for (int i = 0; i < 1000; ++i) {
      before = p;
      momentum.step(p, {1000.0 * p[0]});
    }
  };
  EXPECT_THROW(run(), Diverged);
  EXPECT_EQ(p, before);
  EXPECT_TRUE(std::isfinite(p[0]));
}

TEST(Momentum, RefusesWrongSizesAndSettings) {
  std::vector<double> p = {1.0};
  EXPECT_THROW(Momentum(2, {}).step(p, {1.0}), std::invalid_argument);
  EXPECT_THROW(Momentum(1, {-0.1, 0.5}), std::invalid_argument);
  EXPECT_THROW(Momentum(1, {0.1, 1.0}), std::invalid_argument);
}

// --- conjugate gradients

TEST(ConjugateGradient, SolvesAQuadraticInAsManyStepsAsParametersButForRounding) {
  ConjugateGradient trainer(10);
  std::vector<double> p(10, 0.0);
  const double start = valley(p, nullptr);
  double error = start;
  for (int i = 0; i < 10; ++i) error = trainer.step(valley, p);
  EXPECT_LT(error, 1e-7 * start);
  for (int i = 0; i < 20; ++i) error = trainer.step(valley, p);
  EXPECT_LT(error, 1e-20 * start);
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(p[i], static_cast<double>(i), 1e-9);
}

TEST(ConjugateGradient, FollowsRosenbrocksValleyToItsEndAndNeverGoesUp) {
  ConjugateGradient trainer(2);
  std::vector<double> p = {-1.2, 1.0};
  double error = rosenbrock(p, nullptr);
  for (int i = 0; i < 200 && !trainer.converged(); ++i) {
    const double next = trainer.step(rosenbrock, p);
    ASSERT_LE(next, error) << i;
    EXPECT_DOUBLE_EQ(next, rosenbrock(p, nullptr));
    error = next;
  }
  EXPECT_NEAR(p[0], 1.0, 1e-6);
  EXPECT_NEAR(p[1], 1.0, 1e-6);
}

TEST(ConjugateGradient, SaysWhenItHasConverged) {
  ConjugateGradient trainer(3);
  std::vector<double> p = {0.0, 1.0, 2.0};  // the minimum
  EXPECT_EQ(trainer.step(valley, p), 0.0);
  EXPECT_TRUE(trainer.converged());
  EXPECT_EQ(p, (std::vector<double>{0.0, 1.0, 2.0}));
}

TEST(ConjugateGradient, LearnsXor) {
  Network network = xorNetwork();
  const Samples samples = xorSamples();
  NetworkObjective objective(network, samples, crossEntropy);
  ConjugateGradient trainer(network.parameters().size());
  std::vector<double> p = network.parameters();
  double error = 1.0;
  for (int i = 0; i < 100 && error > 0.01; ++i) error = trainer.step(std::ref(objective), p);
  EXPECT_LT(error, 0.01);
  objective(p, nullptr);
  expectXor(network);
}

TEST(ConjugateGradient, FitsASineInATenthOfTheEpochsOfMomentum) {
  const Samples samples = sineSamples();
  const double goal = 1e-3;
  Network network = sineNetwork();
  NetworkObjective objective(network, samples, halfSquaredError);
  std::vector<double> p = network.parameters();
  ConjugateGradient trainer(p.size());
  int steps = 0;
  for (double error = 1.0; error > goal && steps < 2000; ++steps)
    error = trainer.step(std::ref(objective), p);

  network = sineNetwork();
  p = network.parameters();
  Momentum momentum(p.size(), {0.05, 0.9});
  std::vector<double> gradient;
  int epochs = 0;
  for (double error = 1.0; error > goal && epochs < 20000; ++epochs) {
    error = objective(p, &gradient);
    momentum.step(p, gradient);
  }
  EXPECT_LT(steps, 200);
  EXPECT_LT(epochs, 20000);
  EXPECT_LT(10 * steps, epochs);
}

TEST(ConjugateGradient, ATrialThatIsNotFiniteIsOnlyTooLong) {
  // -log(p) + p: not a number for p < 0, with its minimum at 1.
  const Objective objective = [](const std::vector<double>& p, std::vector<double>* gradient) {
    if (gradient != nullptr) *gradient = {1.0 - 1.0 / p[0]};
    return p[0] - std::log(p[0]);
  };
  ConjugateGradient trainer(1);
  std::vector<double> p = {0.01};
  for (int i = 0; i < 50 && !trainer.converged(); ++i) trainer.step(objective, p);
  EXPECT_NEAR(p[0], 1.0, 1e-6);
  p = {30.0};
  ConjugateGradient other(1);
  for (int i = 0; i < 50 && !other.converged(); ++i) other.step(objective, p);
  EXPECT_NEAR(p[0], 1.0, 1e-6);
}

TEST(ConjugateGradient, DivergenceIsSaidAndLeavesTheParameters) {
  std::vector<double> p = {1.0};
  const Objective no_error = [](const std::vector<double>&, std::vector<double>* gradient) {
    if (gradient != nullptr) *gradient = {1.0};
    return std::nan("");
  };
  const Objective no_gradient = [](const std::vector<double>&, std::vector<double>* gradient) {
    if (gradient != nullptr) *gradient = {std::nan("")};
    return 1.0;
  };
  EXPECT_THROW(ConjugateGradient(1).step(no_error, p), Diverged);
  EXPECT_THROW(ConjugateGradient(1).step(no_gradient, p), Diverged);
  EXPECT_EQ(p, std::vector<double>{1.0});
  EXPECT_THROW(ConjugateGradient(2).step(no_error, p), std::invalid_argument);
}

// --- Levenberg-Marquardt

TEST(LevenbergMarquardt, SolvesALinearProblemInTwoSteps) {
  Network network({Layer::dense(2, 1, Activation::kLinear)});
  const Samples samples{{1, 0, 0, 1, 1, 1, 2, -1}, {5, 0, 3, 10}};  // 3 x1 - 2 x2 + 2
  NetworkResiduals residuals(network, samples);
  LevenbergMarquardt trainer({1e-6, 0.1, 10.0, 1e10});
  std::vector<double> p = network.parameters();
  trainer.step(std::ref(residuals), p);
  EXPECT_LT(trainer.step(std::ref(residuals), p), 1e-12);
  EXPECT_NEAR(p[0], 3.0, 1e-6);
  EXPECT_NEAR(p[1], -2.0, 1e-6);
  EXPECT_NEAR(p[2], 2.0, 1e-6);
}

TEST(LevenbergMarquardt, SolvesRosenbrocksProblemAndNeverGoesUp) {
  const Residuals residuals = [](const std::vector<double>& p, std::vector<double>& errors,
                                 std::vector<double>* jacobian) {
    errors = {1.0 - p[0], -10.0 * (p[1] - p[0] * p[0])};
    if (jacobian != nullptr) *jacobian = {1.0, 0.0, -20.0 * p[0], 10.0};
  };
  LevenbergMarquardt trainer({});
  std::vector<double> p = {-1.2, 1.0};
  double sum = rosenbrock(p, nullptr);
  for (int i = 0; i < 100 && sum > 1e-20; ++i) {
    const double next = trainer.step(residuals, p);
    ASSERT_LE(next, sum);
    sum = next;
  }
  EXPECT_NEAR(p[0], 1.0, 1e-9);
  EXPECT_NEAR(p[1], 1.0, 1e-9);
}

TEST(LevenbergMarquardt, DampingFallsByTenOnSuccessAndRisesByTenOnFailure) {
  Network network({Layer::dense(1, 1, Activation::kLinear)});
  const Samples samples{{1.0, 2.0}, {1.0, 3.0}};
  NetworkResiduals residuals(network, samples);
  LevenbergMarquardt trainer({1e-2, 0.1, 10.0, 1e10});
  std::vector<double> p = network.parameters();
  trainer.step(std::ref(residuals), p);
  EXPECT_DOUBLE_EQ(trainer.mu(), 1e-3);
  // A wall right behind the present place: only a tiny step goes down.
  const Residuals wall = [](const std::vector<double>& q, std::vector<double>& errors,
                            std::vector<double>* jacobian) {
    errors = {q[0] > 1e-3 ? 100.0 : 1.0 - q[0]};
    if (jacobian != nullptr) *jacobian = {1.0};
  };
  LevenbergMarquardt careful({1e-2, 0.1, 10.0, 1e10});
  std::vector<double> q = {0.0};
  careful.step(wall, q);
  EXPECT_NEAR(careful.mu(), 1e2, 1e-6);  // 1e-2 ... 1e3 tried, then a tenth
  EXPECT_NEAR(q[0], 1.0 / 1001.0, 1e-9);
}

TEST(LevenbergMarquardt, SaysWhenItHasConvergedAndLeavesTheParameters) {
  const Residuals flat = [](const std::vector<double>&, std::vector<double>& errors,
                            std::vector<double>* jacobian) {
    errors = {1.0};
    if (jacobian != nullptr) *jacobian = {0.0};
  };
  LevenbergMarquardt trainer({});
  std::vector<double> p = {2.0};
  EXPECT_EQ(trainer.step(flat, p), 1.0);
  EXPECT_TRUE(trainer.converged());
  EXPECT_EQ(p[0], 2.0);
}

TEST(LevenbergMarquardt, DivergenceIsSaidAndLeavesTheParameters) {
  const Residuals bad_error = [](const std::vector<double>&, std::vector<double>& errors,
                                 std::vector<double>* jacobian) {
    errors = {std::nan("")};
    if (jacobian != nullptr) *jacobian = {1.0};
  };
  const Residuals bad_jacobian = [](const std::vector<double>&, std::vector<double>& errors,
                                    std::vector<double>* jacobian) {
    errors = {1.0};
    if (jacobian != nullptr) *jacobian = {std::nan("")};
  };
  std::vector<double> p = {2.0};
  EXPECT_THROW(LevenbergMarquardt({}).step(bad_error, p), Diverged);
  EXPECT_THROW(LevenbergMarquardt({}).step(bad_jacobian, p), Diverged);
  EXPECT_EQ(p[0], 2.0);
}

TEST(LevenbergMarquardt, RefusesImpossibleSettings) {
  EXPECT_THROW(LevenbergMarquardt({0.0, 0.1, 10.0, 1e10}), std::invalid_argument);
  EXPECT_THROW(LevenbergMarquardt({1e-3, 1.0, 10.0, 1e10}), std::invalid_argument);
  EXPECT_THROW(LevenbergMarquardt({1e-3, 0.1, 1.0, 1e10}), std::invalid_argument);
  EXPECT_THROW(LevenbergMarquardt({1e11, 0.1, 10.0, 1e10}), std::invalid_argument);
}

// --- a driver's speed behind a braking car, as in the NARX model of braking: five tanh neurons, one
// delay, 26 parameters, v(k) from [V(k-1), d(k-1), v(k-1)]

struct Braking {
  std::vector<double> lead, gap, own;  // [m/s], [m], [m/s]
};

// An intelligent-driver follower (Treiber et al. 2000) behind a car that brakes at some time, every 0.3
// s.
Braking brakingEvent(std::mt19937_64& random) {
  std::uniform_real_distribution<double> draw(0.0, 1.0);
  Braking event;
  double lead = 10.0 + 10.0 * draw(random);
  double own = lead;
  double gap = 15.0 + 15.0 * draw(random);
  const double deceleration = 3.0 + 4.0 * draw(random);
  const double start = draw(random);
  for (int k = 0; k < 10; ++k) {
    event.lead.push_back(lead);
    event.gap.push_back(gap);
    event.own.push_back(own);
    const double wish = 2.0 + own * 1.0 + own * (own - lead) / (2.0 * std::sqrt(1.5 * 3.0));
    const double acceleration = std::max(1.5 * (1.0 - std::pow(wish / std::max(gap, 1.0), 2)), -8.0);
    if (0.3 * k >= start) lead = std::max(lead - 0.3 * deceleration, 0.0);
    gap += 0.3 * (lead - own);
    own = std::max(own + 0.3 * acceleration, 0.0);
  }
  return event;
}

// Series-parallel: the measured own speed goes in. Speeds in 20 m/s, the gap in 30 m.
void addSamples(const Braking& event, Samples& samples) {
  DelayLine line(3, 1);
  for (std::size_t k = 0; k + 1 < event.own.size(); ++k) {
    const double now[3] = {event.lead[k] / 20.0, event.gap[k] / 30.0, event.own[k] / 20.0};
    line.push(now);
    double inputs[3];
    line.read(inputs);
    samples.inputs.insert(samples.inputs.end(), inputs, inputs + 3);
    samples.targets.push_back(event.own[k + 1] / 20.0);
  }
}

// RMS error of the own speed when the network's own output goes back in [m/s].
double parallelError(const Network& network, const std::vector<Braking>& events) {
  BatchPass pass(network);
  double squares = 0.0;
  std::size_t count = 0;
  for (const Braking& event : events) {
    DelayLine line(3, 1);
    double own = event.own.front() / 20.0;
    for (std::size_t k = 0; k + 1 < event.own.size(); ++k) {
      const double now[3] = {event.lead[k] / 20.0, event.gap[k] / 30.0, own};
      line.push(now);
      double inputs[3];
      line.read(inputs);
      for (std::size_t i = 0; i < 3; ++i) pass.input(i)[0] = inputs[i];
      pass.forward();
      own = pass.output(0)[0];
      squares += std::pow(20.0 * own - event.own[k + 1], 2);
      ++count;
    }
  }
  return std::sqrt(squares / static_cast<double>(count));
}

TEST(Narx, LevenbergMarquardtFitsADriversBrakingAndStopsEarly) {
  std::mt19937_64 random(1);
  std::vector<Braking> events[3];  // training, validation, test
  for (int i = 0; i < 100; ++i) events[i < 70 ? 0 : i < 85 ? 1 : 2].push_back(brakingEvent(random));
  Samples samples[3];
  for (std::size_t part = 0; part < 3; ++part) {
    for (const Braking& event : events[part]) addSamples(event, samples[part]);
  }
  Network network =
      made({Layer::dense(3, 5, Activation::kTanh), Layer::dense(5, 1, Activation::kLinear)}, 1);
  ASSERT_EQ(network.parameters().size(), 26u);
  NetworkResiduals residuals(network, samples[0]);
  NetworkObjective validation(network, samples[1], halfSquaredError);
  LevenbergMarquardt trainer({});
  EarlyStopping stopping(6);
  std::vector<double> p = network.parameters();
  std::vector<double> curve;
  while (stopping.epochs() < 500 && !stopping.stop(validation(p, nullptr), p) && !trainer.converged()) {
    curve.push_back(trainer.step(std::ref(residuals), p) / 630.0);
  }
  for (std::size_t i = 1; i < curve.size(); ++i) ASSERT_LE(curve[i], curve[i - 1]) << i;
  EXPECT_LT(curve[9], 1e-2 * curve[0]);
  network.parameters() = stopping.bestParameters();
  NetworkObjective test(network, samples[2], halfSquaredError);
  EXPECT_LT(20.0 * std::sqrt(2.0 * test(stopping.bestParameters(), nullptr)), 0.15);  // one step [m/s]
  EXPECT_LT(parallelError(network, events[2]), 0.5);                                  // ten steps
}

// --- early stopping, delay line

TEST(EarlyStopping, StopsAfterSixEpochsWithoutABetterOneAndKeepsTheBest) {
  EarlyStopping stopping(6);
  for (int epoch = 0; epoch <= 11; ++epoch) {
    EXPECT_FALSE(stopping.stop(20.0 - epoch, {static_cast<double>(epoch)})) << epoch;
  }
  for (int epoch = 12; epoch <= 16; ++epoch) EXPECT_FALSE(stopping.stop(9.0, {99.0})) << epoch;
  EXPECT_TRUE(stopping.stop(9.0, {99.0}));  // the 17th
  EXPECT_EQ(stopping.bestEpoch(), 11u);
  EXPECT_EQ(stopping.bestError(), 9.0);
  EXPECT_EQ(stopping.bestParameters(), std::vector<double>{11.0});
}

TEST(EarlyStopping, SaysDivergenceAndKeepsTheBest) {
  EarlyStopping stopping(6);
  stopping.stop(1.0, {5.0});
  EXPECT_THROW(stopping.stop(std::nan(""), {6.0}), Diverged);
  EXPECT_EQ(stopping.bestParameters(), std::vector<double>{5.0});
}

TEST(DelayLine, GivesTheNewestFirst) {
  DelayLine line(2, 3);
  ASSERT_EQ(line.size(), 6u);
  for (int k = 1; k <= 5; ++k) {
    const double now[2] = {static_cast<double>(k), 10.0 * k};
    line.push(now);
  }
  double inputs[6];
  line.read(inputs);
  const double expected[6] = {5, 50, 4, 40, 3, 30};
  for (int i = 0; i < 6; ++i) EXPECT_EQ(inputs[i], expected[i]) << i;
  float floats[6];
  line.read(floats);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(floats[i], static_cast<float>(expected[i])) << i;
}

TEST(DelayLine, StartsAtZeroAndCanBeReset) {
  DelayLine line(1, 2);
  double inputs[2] = {9, 9};
  line.read(inputs);
  EXPECT_EQ(inputs[0], 0.0);
  EXPECT_EQ(inputs[1], 0.0);
  const double first = 7.0;
  line.push(&first);
  const double steady = 3.0;
  line.reset(&steady);
  line.read(inputs);
  EXPECT_EQ(inputs[0], 3.0);
  EXPECT_EQ(inputs[1], 3.0);
}

TEST(DelayLine, RefusesNothing) {
  EXPECT_THROW(DelayLine(0, 1), std::invalid_argument);
  EXPECT_THROW(DelayLine(1, 0), std::invalid_argument);
}

}  // namespace
}  // namespace tunnel_pilot::neural

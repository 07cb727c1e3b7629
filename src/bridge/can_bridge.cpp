#include "tunnel_pilot/bridge/can_bridge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::bridge {
namespace {

using supervision::Command;
using supervision::Mode;
using supervision::Reason;
using supervision::Source;
using S = SafetyState;

constexpr double kPi = 3.14159265358979323846;
constexpr double kMaxFrameAngle = 45.0 * kPi / 180.0;  // the .dbc's range of ArticulationAngle [rad]
constexpr Stamp kDiscardPeriod = std::chrono::milliseconds(500);  // a bus that stays off is not hurried
constexpr std::size_t kLongestRejection = 64;                     // kept without an allocation
constexpr double kRounding = 1e-6;  // beyond a limit, by arithmetic alone [rad], [m/s]
// From the time of a tick until its frame is on the bus, at most: what the tick computes, and a frame of
// the others' and one's own at 250 kbit/s, 0.6 ms each.
constexpr Stamp kLeaving = std::chrono::milliseconds(2);

// Reasons with which the arbiter tells that it drives on in less than full health. The others either
// come with a stop or (clearance, obstacle) are answered by the speed it asks for.
bool tellsDegradation(Reason reason) {
  switch (reason) {
    case Reason::kNoSource:
    case Reason::kSourceStale:
    case Reason::kProposalInvalid:
    case Reason::kTunnelInvalid:
    case Reason::kScanStale:
    case Reason::kScanRejected:
    case Reason::kScanFrozen:
    case Reason::kMotionStale:
    case Reason::kLimitsHit:
    case Reason::kSpeedImplausible:
    case Reason::kLowConfidence:
    case Reason::kDriversDisagree:
      return true;
    default:
      return false;
  }
}

bool inside(double value, double min, double max) {
  return std::isfinite(value) && value >= min - kRounding && value <= max + kRounding;
}

bool drives(S state) { return state == S::kActive || state == S::kDegraded; }

template <class Integer>
Integer saturated(std::uint32_t count) {
  return static_cast<Integer>(std::min<std::uint32_t>(count, std::numeric_limits<Integer>::max()));
}

// Starts or stops a stretch of time: since when has `condition` held?
void follow(std::optional<Stamp>& since, bool condition, Stamp now) {
  if (!condition) {
    since.reset();
  } else if (!since) {
    since = now;
  }
}

bool lasts(const std::optional<Stamp>& since, double seconds, Stamp now) {
  return since && now - *since >= fromSeconds(seconds);
}

}  // namespace

CanBridge::CanBridge(const BridgeParameters& parameters, const vehicle::TruckGeometry& truck,
                     can::Bus& bus)
    : parameters_(parameters),
      truck_(truck),
      max_angle_(std::min(truck.max_articulation, kMaxFrameAngle)),
      bus_(bus),
      link_(parameters.feedback_timeout),
      sender_(parameters.frame_period),
      odometry_(truck, parameters.gyro_bias_time, parameters.standstill_speed, parameters.errors,
                parameters.slip),
      watch_(parameters.tracking) {
  status_.command_rejection.reserve(kLongestRejection);
}

// -------- commands and operator

std::string_view CanBridge::whyRefused(const Command& command, Stamp now) const {
  if (!inside(command.articulation_angle, -max_angle_, max_angle_))
    return "articulation angle out of range";
  if (!inside(command.speed, 0.0, parameters_.max_speed)) return "speed out of range";
  if (!inside(command.acceleration, 0.0, parameters_.max_acceleration))
    return "acceleration out of range";
  if (!isKnown(command.mode)) return "unknown mode";
  if (!isKnown(command.source)) return "unknown source";
  if (!isKnown(command.reason)) return "unknown reason";
  if (command.stamp > now + fromSeconds(parameters_.future_tolerance)) return "stamp lies in the future";
  const bool lower = command_ && command.sequence + sequence_offset_ < command_->command.sequence;
  if (lower && (isEngaged(status_.state) || status_.state == S::kStopping)) return "sequence decreases";
  return "";
}

// An arbiter that was started again counts from zero. While not driving it is taken as it is, and its
// numbers are lifted above the last one that was sent.
std::uint32_t CanBridge::monotonous(std::uint32_t sequence) {
  if (command_ && sequence + sequence_offset_ < command_->command.sequence) {
    sequence_offset_ = command_->command.sequence + 1 - sequence;
  }
  return sequence + sequence_offset_;
}

void CanBridge::rejectCommand(const Command& command, std::string_view why, Stamp now) {
  ++status_.commands_rejected;
  status_.command_rejection = why;
  if (!command.stop) return;
  raise(Event::kCommandStop, now, isKnown(command.reason) ? command.reason : Reason::kProposalInvalid);
  sendIfDue(now);
}

void CanBridge::setCommand(const Command& command, Stamp now) {
  const std::string_view why = whyRefused(command, now);
  if (!why.empty()) return rejectCommand(command, why, now);
  const std::uint32_t sequence = monotonous(command.sequence);  // compares with the command before
  command_ = Received{command, now};
  command_->command.sequence = sequence;
  if (command.stop) advance(now);
}

std::string CanBridge::inWords(Event fault) const {
  std::string detail;
  if (fault == Event::kBusFault) detail = bus_.trouble();
  if (fault == Event::kProcessSilent) detail = *silent_process_;
  if (!detail.empty()) detail = ": " + detail;
  return toString(fault) + detail;
}

std::optional<std::string> CanBridge::whyUnhealthy(Stamp now) const {
  if (const std::optional<Event> fault = anyFault(now)) return inWords(*fault);
  if (!lasts(healthy_since_, parameters_.health_time, now)) return "inputs not healthy for long enough";
  return std::nullopt;
}

CanBridge::Answer CanBridge::engage(Stamp now) {
  if (status_.state == S::kInit) {
    return {false, "starting up: " + whyUnhealthy(now).value_or("waiting for the truck")};
  }
  if (isEngaged(status_.state)) return {false, "already engaged"};
  if (isStop(status_.state)) return {false, "stopped: " + toString(status_.reason) + "; reset first"};
  if (const auto why = whyUnhealthy(now)) return {false, *why};
  const Command& command = command_->command;  // healthy: there is one
  const bool arbiter_refuses = tellsDegradation(command.reason) ||
                               command.reason == Reason::kClearance ||
                               command.reason == Reason::kObstacle;
  if (command.stop && arbiter_refuses) return {false, toString(command.reason)};
  raise(Event::kEngage, now);
  advance(now);
  return {true, ""};
}

CanBridge::Answer CanBridge::release(Stamp now) {
  if (!isEngaged(status_.state)) return {false, "not engaged"};
  raise(Event::kOperatorRelease, now);
  advance(now);
  return {true, ""};
}

CanBridge::Answer CanBridge::stop(Stamp now) {
  raise(Event::kOperatorStop, now);
  advance(now);
  return {true, ""};
}

CanBridge::Answer CanBridge::reset(Stamp now) {
  if (status_.state == S::kStopping) return {false, "still stopping"};
  if (status_.state != S::kStopped) return {false, "not stopped"};
  if (const auto why = whyUnhealthy(now)) return {false, *why};
  if (!standing_since_) return {false, "the truck moves"};
  raise(Event::kOperatorReset, now);
  advance(now);
  return {true, ""};
}

void CanBridge::clockJumped(Stamp now) {
  link_.forgetTime();
  sender_.forgetTime(now);
  transmit_.forgetTime(now);
  asked_to_discard_.reset();
  odometry_.forgetTime();
  if (command_) command_->command.stamp = command_->at = Stamp::min() / 2;  // stale in any clock
  link_healthy_since_.reset();
  healthy_since_.reset();
  standing_since_.reset();
  entered_ = last_tick_ = now;
  watch_.reset(link_.feedback().articulation_angle, now);
  raise(Event::kClockJump, now);
  sendIfDue(now);
}

// -------- what is wrong

bool CanBridge::busFaulty() const {
  const can::BusState bus = bus_.state();
  return bus == can::BusState::kBusOff || bus == can::BusState::kDown || transmit_.stalled() ||
         sender_.broken();
}

std::optional<Event> CanBridge::linkFault(Stamp now) const {
  if (busFaulty()) return Event::kBusFault;
  if (link_.foreignSender()) return Event::kForeignSender;
  if (link_.corrupt()) return Event::kFeedbackCorrupt;
  if (!link_.fresh(now)) return Event::kFeedbackStale;
  return std::nullopt;
}

std::optional<Event> CanBridge::truckFault() const {
  if (link_.feedback().operator_override) return Event::kOperatorOverride;
  if (!link_.feedback().operator_enable) return Event::kKeyTurned;
  if (link_.feedback().fault || link_.status().faults != 0) return Event::kTruckFault;
  return std::nullopt;
}

std::optional<Event> CanBridge::commandFault(Stamp now) const {
  if (!command_ || now - command_->at > fromSeconds(parameters_.command_timeout)) {
    return Event::kCommandStale;
  }
  if (now - command_->command.stamp > fromSeconds(parameters_.measurement_timeout)) {
    return Event::kMeasurementStale;
  }
  return std::nullopt;
}

// Asked for while driving: there is a command.
std::optional<Event> CanBridge::drivingFault(Stamp now) const {
  if (now - obeyed_ > fromSeconds(parameters_.obedience_timeout)) return Event::kTruckRefuses;
  if (watch_.failed(now)) return Event::kTrackingError;
  if (command_->command.stop) return Event::kCommandStop;
  return std::nullopt;
}

std::optional<Event> CanBridge::anyFault(Stamp now) const {
  if (const auto fault = linkFault(now)) return fault;
  if (const auto fault = truckFault()) return fault;
  if (silent_process_) return Event::kProcessSilent;
  return commandFault(now);
}

std::optional<Event> CanBridge::degradation(Stamp now) const {
  if (tellsDegradation(command_->command.reason)) return Event::kDegradeAsked;
  if (now - command_->command.stamp > fromSeconds(parameters_.measurement_late)) {
    return Event::kMeasurementLate;
  }
  return std::nullopt;
}

// -------- state machine

void CanBridge::raise(Event event, Stamp now) {
  raise(event, now, command_ ? command_->command.reason : Reason::kNoSource);
}

// `carried` is the command's own reason, told where the table has none.
void CanBridge::raise(Event event, Stamp now, Reason carried) {
  const Transition* row = findTransition(status_.state, event);
  if (row == nullptr || (row->to == status_.state)) return;
  if (row->to != S::kStopped) status_.reason = row->reason.value_or(carried);
  if (row->to == S::kStopping) stop_steers_ = drives(status_.state);
  status_.state = row->to;
  ++status_.transitions;
  entered_ = now;
  held_angle_.reset();
  if (event == Event::kCommandReady) obeyed_ = now;  // the truck's time to obey begins
}

void CanBridge::tick(Stamp now) {
  if (now < last_tick_) clockJumped(now);
  last_tick_ = now;
  sender_.pass(now);
  listen(now);
  advance(now);
}

void CanBridge::listen(Stamp now) {
  const bool news = link_.receive(bus_, now);
  transmit_.update(bus_.inFlight(), now);
  clearBus(now);
  if (!news) return;
  const can::TruckFeedbackFrame& feedback = link_.feedback();
  std::optional<double> gyro;
  if (link_.fresh(now)) gyro = link_.motion().yaw_rate;
  odometry_.update(feedback.articulation_angle, feedback.articulation_rate, feedback.speed, gyro, now);
  if (feedback.autonomy_enabled) obeyed_ = now;
}

void CanBridge::clearBus(Stamp now) {
  if (!busFaulty()) {
    if (bus_.confirmed() > confirmed_in_fault_) asked_to_discard_.reset();  // it has worked since
    return;
  }
  confirmed_in_fault_ = bus_.confirmed();
  if (asked_to_discard_ && now - *asked_to_discard_ < kDiscardPeriod) return;
  asked_to_discard_ = now;
  bus_.discard();
}

void CanBridge::advance(Stamp now) {
  watchSteering(now);
  watchInputs(now);
  watchProgress(now);
  sendIfDue(now);
  updateStatus(now);
}

void CanBridge::watchSteering(Stamp now) {
  if (steering_sent_) {
    watch_.step(sent_angle_, link_.feedback().articulation_angle, now);
  } else {
    watch_.reset(link_.feedback().articulation_angle, now);
  }
}

void CanBridge::watchInputs(Stamp now) {
  const std::optional<Event> link = linkFault(now);
  const std::optional<Event> any = anyFault(now);
  follow(link_healthy_since_, !link, now);
  follow(healthy_since_, !any, now);
  if (any) raise(*any, now);  // any one ends driving, whichever it hides (TransitionTable's test)
  if (drives(status_.state)) {
    if (const auto fault = drivingFault(now)) raise(*fault, now);
  }
}

void CanBridge::watchProgress(Stamp now) {
  const double in_state = toSeconds(now - entered_);
  follow(standing_since_, standsStill(now), now);
  switch (status_.state) {
    case S::kInit:
      if (lasts(link_healthy_since_, parameters_.health_time, now)) raise(Event::kLinkHealthy, now);
      break;
    case S::kArmed:
      if (!command_->command.stop && in_state >= parameters_.arming_time)
        raise(Event::kCommandReady, now);
      else if (in_state >= parameters_.arming_timeout)
        raise(Event::kArmingTimedOut, now);
      break;
    case S::kActive:
    case S::kDegraded: {
      const std::optional<Event> less = degradation(now);
      if (less) raise(*less, now);
      follow(undegraded_since_, !less, now);
      if (lasts(undegraded_since_, parameters_.health_time, now)) raise(Event::kRecovered, now);
      break;
    }
    case S::kStopping:
      if (lasts(standing_since_, parameters_.standstill_time, now) ||
          in_state >= parameters_.stopping_timeout) {
        raise(Event::kStandstill, now);
      }
      break;
    default:
      break;
  }
}

bool CanBridge::standsStill(Stamp now) const {
  return link_.fresh(now) && std::abs(link_.feedback().speed) < parameters_.standstill_speed;
}

// -------- what is sent

bool CanBridge::commandUsable(Stamp now) const { return !commandFault(now + kLeaving); }

bool CanBridge::steeringEnabled(Stamp now) const {
  const bool may = drives(status_.state) || (status_.state == S::kStopping && stop_steers_);
  const can::TruckFeedbackFrame& feedback = link_.feedback();
  return may && link_.fresh(now + kLeaving) && feedback.operator_enable && !feedback.operator_override;
}

bool CanBridge::stopBit(Stamp now) const {
  return isStop(status_.state) || (command_ && commandUsable(now) && command_->command.stop);
}

// Last stage before the codec: no wider than the speed allows (a hold is what was measured), never
// faster than steering_rate, starting from the measured angle.
double CanBridge::limitedAngle(double wanted, bool steering) {
  const double measured = std::clamp(link_.feedback().articulation_angle, -max_angle_, max_angle_);
  if (!steering) return measured;
  const double from = steering_sent_ ? sent_angle_ : measured;
  const double elapsed = std::min(toSeconds(tick_time_.now() - sent_at_), parameters_.frame_period);
  const double step = parameters_.steering_rate * elapsed;
  if (!held_angle_) wanted = std::clamp(wanted, -widestAngle(), widestAngle());
  return std::clamp(wanted, from - step, from + step);
}

// The widest angle that keeps to the lateral acceleration at the higher of the two speeds measured.
double CanBridge::widestAngle() const {
  const double speed =
      std::max(std::abs(link_.feedback().speed), std::abs(link_.motion().front_axle_speed));
  if (speed <= 0.0) return max_angle_;
  return vehicle::steadyArticulation(truck_, parameters_.max_lateral_acceleration / (speed * speed));
}

// What drives may be too old once it is on the bus, though it is not yet: then nothing is sent, and the
// next tick has news or stops.
bool CanBridge::tooOldOnTheBus(Stamp now) const {
  return drives(status_.state) && (!link_.fresh(now + kLeaving) || !commandUsable(now));
}

void CanBridge::sendIfDue(Stamp now) {
  tick_time_.tick(now);
  if (transmit_.full() || transmit_.stalled() || !sender_.due(stopBit(now), now)) return;
  if (tooOldOnTheBus(now)) return;
  const can::TruckCommandFrame command = composeCommand(now);
  const can::CommandInfoFrame info = composeInfo(now);
  const std::uint64_t in_flight = bus_.inFlight();
  if (!sender_.send(command, info, composeStatus(now), bus_, now)) return;
  transmit_.sent(std::max(bus_.inFlight(), in_flight) - in_flight, now);
  sent_angle_ = command.articulation_angle;
  // When the bus takes no commands (it is down, or claims its address) the angle begins at the measured
  // one. One that takes the command and nothing more has let the angle out.
  steering_sent_ = command.steering_enable && !sender_.silent();
  sent_at_ = tick_time_.now();
}

can::TruckCommandFrame CanBridge::composeCommand(Stamp now) {
  const bool steering = steeringEnabled(now);
  const bool stopping = isStop(status_.state);
  const double measured = link_.feedback().articulation_angle;
  if (commandUsable(now)) {
    held_angle_.reset();
  } else if (!held_angle_) {
    held_angle_ = std::clamp(measured, -max_angle_, max_angle_);
  }
  const Command command = command_ ? command_->command : Command();
  can::TruckCommandFrame frame;
  frame.steering_enable = steering;
  frame.stop = stopBit(now);
  frame.mode = static_cast<std::uint8_t>(
      isEngaged(status_.state) || status_.state == S::kStopping ? command.mode : Mode::kStandby);
  frame.articulation_angle = limitedAngle(held_angle_.value_or(command.articulation_angle), steering);
  if (steering && !frame.stop) {
    const double highest =
        status_.state == S::kDegraded ? parameters_.degraded_speed : parameters_.max_speed;
    frame.speed = std::clamp(command.speed, 0.0, highest);
    frame.acceleration = std::clamp(command.acceleration, 0.0, parameters_.max_acceleration);
  } else {
    frame.acceleration = parameters_.stop_deceleration;
  }
  frame.reason = static_cast<std::uint8_t>(stopping || !command_ ? status_.reason : command.reason);
  return frame;
}

can::CommandInfoFrame CanBridge::composeInfo(Stamp now) const {
  const Command command = command_ ? command_->command : Command();
  const bool usable = commandUsable(now);
  const Stamp stamp = usable ? command.stamp : link_.feedbackStamp();
  constexpr std::int64_t kModulus = 65536;  // [ms]
  const std::int64_t milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(stamp).count();
  can::CommandInfoFrame frame;
  frame.source = static_cast<std::uint8_t>(usable ? command.source : Source::kHold);
  frame.measurement_stamp_ms =
      static_cast<std::uint16_t>(((milliseconds % kModulus) + kModulus) % kModulus);
  frame.sequence = command.sequence;
  return frame;
}

can::BridgeStatusFrame CanBridge::composeStatus(Stamp now) const {
  can::BridgeStatusFrame frame;
  frame.state = static_cast<std::uint8_t>(status_.state);
  frame.reason = static_cast<std::uint8_t>(status_.reason);
  frame.feedback_age = std::clamp(link_.age(now), 0.0, 0.255);
  frame.frames_rejected = saturated<std::uint16_t>(link_.framesRejected());
  frame.commands_rejected = saturated<std::uint16_t>(status_.commands_rejected);
  return frame;
}

void CanBridge::updateStatus(Stamp now) {
  const can::TruckFeedbackFrame& feedback = link_.feedback();
  status_.stamp = now;
  status_.autonomy_enabled = feedback.autonomy_enabled;
  status_.operator_enable = feedback.operator_enable;
  status_.operator_override = feedback.operator_override;
  status_.faults = link_.status().faults;
  status_.brake_pressure = link_.status().brake_pressure;
  status_.payload = link_.status().payload;
  status_.steering_wheel = link_.operatorInputs().steering_wheel;
  status_.throttle_pedal = link_.operatorInputs().throttle;
  status_.brake_pedal = link_.operatorInputs().brake;
  status_.yaw_rate = link_.motion().yaw_rate;
  status_.longitudinal_acceleration = link_.motion().acceleration;
  const auto coils =
      std::copy(link_.coils1().coils.begin(), link_.coils1().coils.end(), status_.coils.begin());
  std::copy(link_.coils2().coils.begin(), link_.coils2().coils.end(), coils);
  status_.feedback_age = link_.age(now);
  status_.command_age =
      command_ ? toSeconds(now - command_->at) : std::numeric_limits<double>::infinity();
  status_.tracking_error = watch_.error();
  status_.frames_received = link_.framesReceived();
  status_.frames_rejected = link_.framesRejected();
  status_.frames_sent = sender_.framesSent();
}

}  // namespace tunnel_pilot::bridge

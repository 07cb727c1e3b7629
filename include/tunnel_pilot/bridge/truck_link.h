#pragma once

#include <optional>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/protection.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// The listening half of the bridge: takes frames off the bus, lets through what the .dbc allows, and
/// knows how old and how trustworthy the truck's last words are. Identifiers that are not the truck's
/// are discarded; our own, sent by someone else, are told.
class TruckLink {
 public:
  /// `timeout` [s] of each of TRUCK_FEEDBACK, TRUCK_MOTION and TRUCK_STATUS.
  explicit TruckLink(double timeout);

  /// Reads all that waits on the bus (at most kFramesPerTick frames, more than a bus of 1 Mbit/s can
  /// carry in 20 ms). True when a new TRUCK_FEEDBACK was among it.
  bool receive(can::Bus& bus, Stamp now);

  /// Nothing received so far counts as fresh any more.
  void forgetTime();

  bool fresh(Stamp now) const;  ///< all three frames within the timeout
  double age(Stamp now) const;  ///< of the oldest of the three [s], infinite before they came
  bool corrupt() const;         ///< three of the last ten of one of them were wrong
  bool foreignSender() const { return foreign_sender_; }  ///< in the last receive()

  const can::TruckFeedbackFrame& feedback() const { return feedback_.latest; }
  const can::TruckMotionFrame& motion() const { return motion_.latest; }
  const can::TruckStatusFrame& status() const { return status_.latest; }
  const can::OperatorFrame& operatorInputs() const { return operator_.latest; }
  const can::Coils1Frame& coils1() const { return coils1_.latest; }
  const can::Coils2Frame& coils2() const { return coils2_.latest; }
  Stamp feedbackStamp() const { return feedback_.received.value_or(Stamp{}); }

  std::uint32_t framesReceived() const { return frames_received_; }
  std::uint32_t framesRejected() const { return frames_rejected_; }

 private:
  static constexpr int kFramesPerTick = 256;

  template <class Fields>
  struct Stream {
    Fields latest;
    std::optional<Stamp> received;
    can::StreamCheck check;
  };

  template <class Fields>
  bool take(Stream<Fields>& stream, const can::Frame& frame);
  bool dispatch(const can::Frame& frame);

  double timeout_;
  Stream<can::TruckFeedbackFrame> feedback_;
  Stream<can::TruckMotionFrame> motion_;
  Stream<can::TruckStatusFrame> status_;
  Stream<can::OperatorFrame> operator_;
  Stream<can::Coils1Frame> coils1_;
  Stream<can::Coils2Frame> coils2_;
  std::optional<Stamp> last_call_;
  Stamp earliest_{};  ///< that the frames of this call may have come
  bool new_feedback_ = false;
  bool foreign_sender_ = false;
  std::uint32_t frames_received_ = 0;
  std::uint32_t frames_rejected_ = 0;
};

}  // namespace tunnel_pilot::bridge

#pragma once

#include <array>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// The speaking half of the bridge: sends TP_COMMAND, TP_COMMAND_INFO and TP_STATUS together, each time
/// with a new alive counter, every period and at once when a stop is asked for. Never late frames in a
/// burst, and never more than kMaxFrames of one identifier in any kWindow. The bound has a time of its
/// own, to which no tick adds more than kLongestTick: a clock that jumps, to and fro, makes no room.
class CommandSender {
 public:
  static constexpr std::size_t kMaxFrames = 16;
  static constexpr Stamp kWindow = std::chrono::milliseconds(250);
  /// By which a tick may come before the period is over and still be the one: the next would be late.
  static constexpr Stamp kEarly = std::chrono::microseconds(500);
  static constexpr Stamp kLongestTick = std::chrono::milliseconds(25);

  /// `period` [s]
  explicit CommandSender(double period);

  /// It is `now`. To be called with every tick; send() calls it, too.
  void pass(Stamp now);

  /// A frame is to be sent now: the period is over, or `stop` asks for a stop that no frame told yet.
  bool due(bool stop, Stamp now) const;

  /// Sends one set; the counters of the structs are filled in here. False: blocked by the bound on the
  /// rate, nothing was sent and no counter used.
  bool send(can::TruckCommandFrame command, can::CommandInfoFrame info, can::BridgeStatusFrame status,
            can::Bus& bus, Stamp now);

  /// Begins a new time base at `now`: the next set is due at once, if the bound on the rate allows it;
  /// for that, no time has passed.
  void forgetTime(Stamp now);

  bool broken() const {
    return failed_in_row_ >= kInRow;
  }  ///< of the last three sets none went out whole
  bool silent() const {
    return refused_in_row_ >= kInRow;
  }  ///< of the last three commands none went out
  std::uint32_t framesSent() const { return frames_sent_; }
  std::uint32_t setsFailed() const { return sets_failed_; }    ///< bus full or down, or not encodable
  std::uint32_t setsBlocked() const { return sets_blocked_; }  ///< by the bound on the rate

 private:
  static constexpr int kInRow = 3;

  template <class Fields>
  bool sendOne(const Fields& fields, can::Bus& bus);
  bool withinRate() const;

  Stamp period_;
  Stamp next_{};
  bool started_ = false;
  bool stop_told_ = false;
  std::uint8_t counter_ = 0;
  Stamp passed_at_{};                        ///< the last tick, by the clock
  Stamp counted_{};                          ///< it, by the bound's own time
  std::array<Stamp, kMaxFrames> sent_at_{};  ///< ring of the last sets, by that time
  std::size_t sets_sent_ = 0;
  int failed_in_row_ = 0;
  int refused_in_row_ = 0;
  std::uint32_t frames_sent_ = 0;
  std::uint32_t sets_failed_ = 0;
  std::uint32_t sets_blocked_ = 0;
};

}  // namespace tunnel_pilot::bridge

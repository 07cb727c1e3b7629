#include "tunnel_pilot/can/log_writer.h"

#include <algorithm>
#include <cstdio>

namespace tunnel_pilot::can {
namespace {

constexpr const char* kInterface = "can0";

std::string toText(Stamp stamp) {
  const long long microseconds = std::chrono::duration_cast<std::chrono::microseconds>(stamp).count();
  char text[48];
  std::snprintf(text, sizeof text, "(%lld.%06lld)", microseconds / 1'000'000, microseconds % 1'000'000);
  return text;
}

}  // namespace

std::string toText(const Frame& frame) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string text;
  for (int shift = frame.extended ? 28 : 8; shift >= 0; shift -= 4) {
    text += kDigits[frame.id >> shift & 0xFU];
  }
  text += '#';
  for (std::size_t i = 0; i < std::min<std::size_t>(frame.length, frame.data.size()); ++i) {
    text += kDigits[frame.data[i] >> 4U];
    text += kDigits[frame.data[i] & 0xFU];
  }
  return text;
}

void LogWriter::frame(const Frame& frame, Stamp now) {
  out_ << toText(now) << ' ' << kInterface << ' ' << can::toText(frame) << '\n';
}

void LogWriter::event(const std::string& words, Stamp now) {
  out_ << toText(now) << " event " << words << '\n';
}

}  // namespace tunnel_pilot::can

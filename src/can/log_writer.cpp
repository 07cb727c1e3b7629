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
  char text[32];
  const int start = std::snprintf(text, sizeof text, frame.extended ? "%08X#" : "%03X#", frame.id);
  std::string result(text, static_cast<std::size_t>(start));
  for (std::size_t i = 0; i < std::min<std::size_t>(frame.length, frame.data.size()); ++i) {
    std::snprintf(text, sizeof text, "%02X", frame.data[i]);
    result += text;
  }
  return result;
}

void LogWriter::frame(const Frame& frame, Stamp now) {
  out_ << toText(now) << ' ' << kInterface << ' ' << can::toText(frame) << '\n';
}

void LogWriter::event(const std::string& words, Stamp now) {
  out_ << toText(now) << " event " << words << '\n';
}

}  // namespace tunnel_pilot::can

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace tunnel_pilot::config {

/// SHA-256 (FIPS 180-4), piece by piece.
class Sha256 {
 public:
  void update(const void* data, std::size_t size);
  /// Of all pieces, in hexadecimal. Call it once, last.
  std::string finish();

 private:
  std::array<std::uint32_t, 8> hash_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                        0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> block_{};
  std::uint64_t size_ = 0;  ///< so far [bytes]
};

/// SHA-256 of a text, in hexadecimal.
std::string sha256(const std::string& text);

}  // namespace tunnel_pilot::config

#include "platform/sha256.hpp"

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "platform/errors.hpp"
#include "platform/lists.hpp"

namespace endosdk {
namespace {

constexpr size_t block_size = 64;
using State = std::array<uint32_t, 8>;

// The first 32 bits of the fractional parts of the square and cube roots of the first primes.
struct Constants {
  State start{};
  std::array<uint32_t, 64> round{};

  Constants() {
    size_t count = 0;
    for (uint32_t n = 2; count < round.size(); ++n) {
      bool prime = true;
      for (uint32_t d = 2; d * d <= n; ++d) prime = prime && n % d != 0;
      if (!prime) continue;
      if (count < start.size()) start[count] = fraction(n, 2);
      round[count++] = fraction(n, 3);
    }
  }

  // floor(2^32 * n^(1/power)) modulo 2^32, found bit by bit.
  static uint32_t fraction(uint32_t n, int power) {
    __extension__ using Wide = unsigned __int128;
    uint64_t root = 0;
    for (int bit = 36; bit >= 0; --bit) {
      const uint64_t candidate = root | uint64_t{1} << bit;
      Wide value = candidate;
      for (int i = 1; i < power; ++i) value *= candidate;
      if (value <= Wide{n} << (32 * power)) root = candidate;
    }
    return static_cast<uint32_t>(root);
  }
};

uint32_t big_endian(const uint8_t* bytes) {
  return uint32_t{bytes[0]} << 24 | uint32_t{bytes[1]} << 16 | uint32_t{bytes[2]} << 8 | uint32_t{bytes[3]};
}

void compress(State& state, const uint8_t* block, const Constants& constants) {
  std::array<uint32_t, 64> w;
  for (size_t i = 0; i < 16; ++i) w[i] = big_endian(block + 4 * i);
  for (size_t i = 16; i < 64; ++i) {
    const uint32_t a = w[i - 15];
    const uint32_t b = w[i - 2];
    const uint32_t s0 = std::rotr(a, 7) ^ std::rotr(a, 18) ^ a >> 3;
    const uint32_t s1 = std::rotr(b, 17) ^ std::rotr(b, 19) ^ b >> 10;
    w[i] = w[i - 16] + s0 + w[i - 7] + s1;
  }
  State s = state;
  for (size_t i = 0; i < 64; ++i) {
    const uint32_t sum1 = std::rotr(s[4], 6) ^ std::rotr(s[4], 11) ^ std::rotr(s[4], 25);
    const uint32_t choice = (s[4] & s[5]) ^ (~s[4] & s[6]);
    const uint32_t first = s[7] + sum1 + choice + constants.round[i] + w[i];
    const uint32_t sum0 = std::rotr(s[0], 2) ^ std::rotr(s[0], 13) ^ std::rotr(s[0], 22);
    const uint32_t majority = (s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]);
    s = {first + sum0 + majority, s[0], s[1], s[2], s[3] + first, s[4], s[5], s[6]};
  }
  for (size_t i = 0; i < state.size(); ++i) state[i] += s[i];
}

}  // namespace

std::string sha256(const void* data, size_t size) {
  static const Constants constants;
  const auto* bytes = static_cast<const uint8_t*>(data);
  State state = constants.start;
  size_t done = 0;
  for (; done + block_size <= size; done += block_size) compress(state, bytes + done, constants);

  // The rest, a one bit, zeros, and the length in bits.
  std::array<uint8_t, 2 * block_size> tail{};
  const size_t rest = size - done;
  if (rest > 0) std::memcpy(tail.data(), bytes + done, rest);
  tail[rest] = 0x80;
  const size_t padded = rest + 9 <= block_size ? block_size : 2 * block_size;
  const uint64_t bits = uint64_t{size} * 8;
  for (size_t i = 0; i < 8; ++i) tail[padded - 1 - i] = static_cast<uint8_t>(bits >> (8 * i));
  for (size_t at = 0; at < padded; at += block_size) compress(state, tail.data() + at, constants);

  std::string digest;
  for (uint32_t word : state) {
    for (int shift = 28; shift >= 0; shift -= 4) digest += "0123456789abcdef"[word >> shift & 15];
  }
  return digest;
}

void check_sha256_form(const std::string& text, const std::string& argument) {
  const bool well_formed = text.size() == 64 && text.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
  require(text.empty() || well_formed, argument, "must be 64 hexadecimal digits", in_quotes(text));
}

void check_sha256(const std::string& seen, const std::string& expected, endo_status mismatch, const std::string& argument,
                  const std::string& origin) {
  if (expected.empty()) return;
  check_sha256_form(expected, argument + "_sha256");
  std::string wanted = expected;
  for (char& c : wanted) c = c >= 'A' && c <= 'F' ? static_cast<char>(c - 'A' + 'a') : c;
  require(wanted == seen, mismatch, argument, origin + " must have SHA-256 " + wanted, seen);
}

}  // namespace endosdk

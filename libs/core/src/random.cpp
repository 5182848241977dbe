#include "vestibule/core/random.hpp"

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule {
namespace {

constexpr std::uint32_t kPhiloxMul0 = 0xD2511F53U;
constexpr std::uint32_t kPhiloxMul1 = 0xCD9E8D57U;
constexpr std::uint32_t kPhiloxWeyl0 = 0x9E3779B9U;
constexpr std::uint32_t kPhiloxWeyl1 = 0xBB67AE85U;
constexpr int kPhiloxRounds = 10;

std::uint32_t high(std::uint64_t v) { return static_cast<std::uint32_t>(v >> 32U); }
std::uint32_t low(std::uint64_t v) { return static_cast<std::uint32_t>(v & 0xFFFFFFFFU); }

// FNV-1a, 64 bit: a stable name hash (std::hash may change between library versions).
std::uint64_t hashName(std::string_view name) {
  std::uint64_t h = 0xCBF29CE484222325ULL;
  for (const char c : name) {
    h = (h ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  }
  return h;
}

}  // namespace

std::array<std::uint32_t, 4> philox4x32(
    std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < kPhiloxRounds; ++round) {
    const std::uint64_t p0 = static_cast<std::uint64_t>(kPhiloxMul0) * counter[0];
    const std::uint64_t p1 = static_cast<std::uint64_t>(kPhiloxMul1) * counter[2];
    counter = {high(p1) ^ counter[1] ^ key[0], low(p1), high(p0) ^ counter[3] ^ key[1], low(p0)};
    key[0] += kPhiloxWeyl0;
    key[1] += kPhiloxWeyl1;
  }
  return counter;
}

RandomStream::RandomStream(std::uint64_t seed, std::string_view name, std::uint64_t index)
    : key_{low(seed), high(seed)} {
  // Words 2 and 3 of the counter name the stream; words 0 and 1 count its blocks.
  const std::uint64_t stream = derivedSeed(seed, name, index);
  counter_ = {0, 0, low(stream), high(stream)};
}

RandomStream::result_type RandomStream::operator()() {
  if (next_word_ == 4) {
    block_ = philox4x32(counter_, key_);
    if (++counter_[0] == 0) ++counter_[1];
    next_word_ = 0;
  }
  return block_[next_word_++];
}

double RandomStream::uniform() {
  const std::uint64_t hi = (*this)() >> 5U;
  const std::uint64_t lo = (*this)() >> 6U;
  return static_cast<double>((hi << 26U) | lo) * 0x1.0p-53;
}

double RandomStream::uniform(double low_value, double high_value) {
  return low_value + (high_value - low_value) * uniform();
}

double RandomStream::normal() {
  if (has_spare_normal_) {
    has_spare_normal_ = false;
    return spare_normal_;
  }
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  const double angle = 2.0 * kPi * uniform();
  spare_normal_ = radius * std::sin(angle);
  has_spare_normal_ = true;
  return radius * std::cos(angle);
}

double RandomStream::normal(double mean, double sigma) { return mean + sigma * normal(); }

double RandomStream::exponential(double mean) { return -mean * std::log(1.0 - uniform()); }

bool RandomStream::bernoulli(double probability) { return uniform() < probability; }

std::uint64_t derivedSeed(std::uint64_t seed, std::string_view name, std::uint64_t index) {
  const std::uint64_t name_hash = hashName(name);
  const auto words = philox4x32(
      {low(name_hash), high(name_hash), low(index), high(index)}, {low(seed), high(seed)});
  return (static_cast<std::uint64_t>(words[1]) << 32U) | words[0];
}

}  // namespace vestibule

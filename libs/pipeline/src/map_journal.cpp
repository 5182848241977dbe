#include "map_journal.hpp"

#include <cstring>
#include <filesystem>
#include <iterator>
#include <optional>

#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::pipeline {
namespace {

const std::string kMagic = "vestibule map journal 1\n";

// Numbers are written as this machine holds them: a journal is for going on where it was written.
template <class T>
void put(std::string& bytes, const T& value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

template <class T>
T take(const std::string& bytes, std::size_t& at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  at += sizeof(T);
  return value;
}

std::uint64_t checksum(const std::string& bytes) { return derivedSeed(0, bytes); }

constexpr std::size_t kReportBytes =
    sizeof(std::uint64_t) + 2 * sizeof(double) + sizeof(std::uint32_t);
constexpr std::size_t kParticleBytes = sizeof(std::uint32_t) + 5 * sizeof(double);

std::string payloadOf(const mapping::Generation& g) {
  std::string bytes;
  put(bytes, static_cast<std::uint64_t>(g.scan));
  put(bytes, g.report.effective_particles);
  put(bytes, g.report.known_share);
  put(bytes, static_cast<std::uint32_t>((g.report.resampled ? 1 : 0) | (g.report.slipped ? 2 : 0)));
  for (std::size_t i = 0; i < g.poses.size(); ++i) {
    put(bytes, g.parents[i]);
    put(bytes, g.poses[i].x);
    put(bytes, g.poses[i].y);
    put(bytes, g.poses[i].phi);
    put(bytes, g.log_weights[i]);
    put(bytes, g.scores[i]);
  }
  return bytes;
}

mapping::Generation generationOf(const std::string& bytes, std::size_t particles) {
  mapping::Generation g;
  std::size_t at = 0;
  g.scan = take<std::uint64_t>(bytes, at);
  g.report.used = true;
  g.report.effective_particles = take<double>(bytes, at);
  g.report.known_share = take<double>(bytes, at);
  const auto flags = take<std::uint32_t>(bytes, at);
  g.report.resampled = (flags & 1U) != 0;
  g.report.slipped = (flags & 2U) != 0;
  for (std::size_t i = 0; i < particles; ++i) {
    g.parents.push_back(take<std::uint32_t>(bytes, at));
    const auto x = take<double>(bytes, at);
    const auto y = take<double>(bytes, at);
    const auto phi = take<double>(bytes, at);
    g.poses.push_back({x, y, phi});
    g.log_weights.push_back(take<double>(bytes, at));
    g.scores.push_back(take<double>(bytes, at));
  }
  return g;
}

}  // namespace

MapJournal::MapJournal(std::string path, std::uint64_t identity, std::size_t particles, bool resume)
    : path_(std::move(path)), particles_(particles) {
  const std::size_t payload_bytes = kReportBytes + particles * kParticleBytes;
  std::string header = kMagic;
  put(header, identity);
  std::string bytes;
  if (resume) {
    std::ifstream in(path_, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  std::size_t sound = header.size();  // bytes that can be kept
  if (bytes.size() < header.size()) {
    bytes.clear();  // nothing yet, or killed while the header was written
  } else if (bytes.compare(0, header.size(), header) != 0) {
    throw ConfigError(
        path_ +
        ": is of a run with another recording or configuration; give what that run was given, or "
        "leave --resume out to start anew");
  }
  for (std::size_t at = header.size();
       at + payload_bytes + sizeof(std::uint64_t) <= bytes.size();) {
    const std::string payload = bytes.substr(at, payload_bytes);
    at += payload_bytes;
    if (take<std::uint64_t>(bytes, at) != checksum(payload)) break;
    recorded_.push_back(generationOf(payload, particles_));
    sound = at;
  }
  if (bytes.empty()) {
    header_ = header;  // the file appears with its first record
    std::error_code error;
    std::filesystem::remove(path_, error);
    return;
  }
  std::error_code error;
  std::filesystem::resize_file(path_, sound, error);
  out_.open(path_, std::ios::binary | std::ios::app);
  if (!out_) throw ConfigError(path_ + ": cannot be written; choose another --out folder");
}

void MapJournal::append(const mapping::Generation& generation) {
  std::string record = payloadOf(generation);
  put(record, checksum(record));
  if (!out_.is_open()) out_.open(path_, std::ios::binary | std::ios::trunc);
  out_ << header_ << record << std::flush;
  header_.clear();
  if (!out_) throw ConfigError(path_ + ": cannot be written (disk full?)");
}

}  // namespace vestibule::pipeline

#include "vestibule/tuning/session.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "session_target.hpp"
#include "test_files.hpp"
#include "tuning_test_support.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/tuning/search_space.hpp"

namespace vestibule::tuning {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using vestibule::test::shipped;
using vestibule::test::TempFolder;

constexpr const char* kGood =
    "parameters:\n"
    "  - {name: ekf.gyro.noise_rad_sqrt_s, from: 0.0002, to: 0.02}\n"
    "recordings:\n"
    "  training:\n"
    "    - {scenario: open_sky, drives: 2}\n"
    "  validation:\n"
    "    - {scenario: open_sky, first_seed: 11}\n"
    "objectives:\n"
    "  - {measure: innovation_likelihood}\n";

Session parsed(const std::string& yaml) {
  return parseSession(yaml, "s.yaml", shipped("config/scenarios"));
}

std::string complaint(const std::string& yaml) { return test::complaintOf(parsed, yaml); }

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

TEST(Session, ReadsAGoodOne) {
  const Session session = parsed(kGood);
  EXPECT_EQ(session.subject, SubjectKind::kEkf);
  ASSERT_EQ(session.parameters.size(), 1U);
  EXPECT_TRUE(session.parameters[0].log);
  EXPECT_EQ(session.recordings.training[0].drives, 2);
}

TEST(Session, EverythingWrongIsSaidAtOnceWithItsLine) {
  const std::string text = complaint(
      "parameters:\n"
      "  - {name: ekf.gyro.noise_rad_sqrts, from: 0.0002, to: 0.02}\n"
      "  - {name: ekf.wheels.scale_sigma, from: 0.3, to: 0.01}\n"
      "  - {name: ekf.init.trust_heading, from: 1, to: 2}\n"
      "recordings:\n"
      "  training:\n"
      "    - {log: gone.bag}\n"
      "    - {scenario: open_sky, drives: 5}\n"
      "  validation:\n"
      "    - {scenario: open_sky, first_seed: 3}\n"
      "objectives:\n"
      "  - {measure: innovation_likelihood}\n"
      "  - {measure: relations}\n"
      "serch: {evaluations: 10}\n");
  EXPECT_THAT(
      text,
      AllOf(
          HasSubstr("s.yaml:2: parameters: ekf.gyro.noise_rad_sqrts: unknown parameter (did you "
                    "mean ekf.gyro.noise_rad_sqrt_s?)"),
          HasSubstr("s.yaml:3: parameters[1].to: empty range: from 0.3 to 0.01"),
          HasSubstr("s.yaml:4: parameters: ekf.init.trust_heading: is not a number"),
          HasSubstr("s.yaml:7: recordings.training[0].log: no such file: gone.bag"),
          HasSubstr("s.yaml:10: recordings.validation: open_sky is in training too (line 8)"),
          HasSubstr("s.yaml:13: objectives: relations cannot be measured of ekf"),
          HasSubstr("s.yaml:14: serch: unknown key (did you mean search?)")));
}

TEST(Session, RangesMustBeWhatTheConfigurationTakes) {
  EXPECT_THAT(
      complaint(replaced(
          kGood, "ekf.gyro.noise_rad_sqrt_s, from: 0.0002", "ekf.wheels.scale_sigma, from: 1e-9")),
      AllOf(HasSubstr("s.yaml:2: parameters: at 1e-09"), HasSubstr("ekf.wheels.scale_sigma")));
  EXPECT_THAT(
      complaint(replaced(kGood, "from: 0.0002", "from: 0")),
      HasSubstr("a log scale needs a range above 0"));
}

TEST(Session, AParameterThatChangesNothingIsNotTuned) {
  EXPECT_THAT(
      complaint(replaced(
          kGood, "ekf.gyro.noise_rad_sqrt_s, from: 0.0002", "mapping.filter.particles, from: 5")),
      HasSubstr("s.yaml:2: parameters: mapping.filter.particles: has no effect on ekf"));
}

TEST(Session, ASetMayNotSeeTheSecondsOfAnother) {
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  const auto with = [&log](const std::string& training, const std::string& validation) {
    return complaint(
        "parameters:\n  - {name: ekf.gyro.noise_rad_sqrt_s, from: 0.0002, to: 0.02}\n"
        "recordings:\n  training:\n    - {log: " +
        log + training + "}\n  validation:\n    - {log: " + log + validation +
        "}\nobjectives:\n  - {measure: nis}\n");
  };
  EXPECT_EQ(with(", blocks: even", ", blocks: odd"), "no complaint");
  EXPECT_THAT(with("", ""), HasSubstr("is in training too (line 5)"));
  EXPECT_THAT(with(", blocks: even", ""), HasSubstr("is in training too"));
}

TEST(Session, ACopyIsNoOtherRecording) {
  const TempFolder folder;
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  const std::string copy = folder / "other_day.bag";
  std::filesystem::copy_file(log, copy);
  const auto with = [&](const std::string& validation) {
    return complaint(
        "parameters:\n  - {name: ekf.gyro.noise_rad_sqrt_s, from: 0.0002, to: 0.02}\n"
        "recordings:\n  training: [{log: " +
        log + "}]\n  validation: [{log: " + validation + "}]\nobjectives: [{measure: nis}]\n");
  };
  EXPECT_THAT(with(copy), HasSubstr("other_day.bag is in training too (line 4)"));
  std::ofstream(copy, std::ios::app) << "one byte more";
  EXPECT_EQ(with(copy), "no complaint");
}

TEST(Session, ABoundThatIsNoNumberIsOneComplaint) {
  EXPECT_EQ(
      complaint(replaced(kGood, "from: 0.0002", "from: .nan")),
      "s.yaml:2: parameters[0].from: must be a number, is '.nan'");
  EXPECT_EQ(
      complaint(replaced(kGood, "to: 0.02", "to: .inf")),
      "s.yaml:2: parameters[0].to = .inf: must be finite");
}

TEST(Session, NeedsWhatItsSubjectNeeds) {
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  EXPECT_THAT(
      complaint(
          "tune: amcl\nparameters:\n  - {name: amcl.likelihood_field.sigma_hit_m, from: 0.01, to: "
          "1}\n"
          "recordings:\n  training:\n    - {log: " +
          log + ", blocks: even}\n  validation:\n    - {log: " + log +
          ", blocks: odd}\nobjectives:\n  - {measure: relations}\n"),
      AllOf(HasSubstr("amcl needs a map"), HasSubstr("needs a relations file")));
}

/// Every file of the corpus, whole, cut anywhere and damaged: read or complained of, nothing else.
TEST(Session, CorpusIsSurvived) {
  const std::filesystem::path folder =
      std::filesystem::path(VESTIBULE_SOURCE_DIR) / "libs/tuning/fuzz/corpus/session";
  int n = 0;
  RandomStream random(1, "damage");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string bytes = vestibule::test::readFile(entry.path());
    EXPECT_NO_THROW(fuzz::readSession(bytes)) << entry.path();
    for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 10) {
      EXPECT_NO_THROW(fuzz::readSession(bytes.substr(0, size))) << entry.path() << " at " << size;
    }
    for (int k = 0; k < 10 && !bytes.empty(); ++k) {
      std::string damaged = bytes;
      damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
      damaged.erase(random() % damaged.size(), random() % 20);
      EXPECT_NO_THROW(fuzz::readSession(damaged)) << damaged;
    }
    ++n;
  }
  EXPECT_GE(n, 8);
}

TEST(SearchSpace, RoundTripsAndKeepsTies) {
  const ParameterTree tree{pipeline::Config{}};
  const SearchSpace space(
      {{"ekf.wheels.distance_sigma_sqrt_m",
        0.005,
        0.5,
        true,
        {"ekf.wheels.lateral_sigma_sqrt_m"},
        {}},
       {"mapping.filter.particles", 10, 200, false, {}, {}}},
      tree);
  EXPECT_EQ(space.defaults(), (std::vector<double>{0.05, 15.0}));
  const auto values = space.values({0.5, 0.333});
  EXPECT_DOUBLE_EQ(values[0], 0.05);
  EXPECT_EQ(values[1], std::round(values[1]));
  const auto named = space.named({0.1, 50});
  ASSERT_EQ(named.size(), 3U);
  EXPECT_DOUBLE_EQ(named[1].second, 0.06);
  const auto back = space.cube(values);
  EXPECT_NEAR(back[0], 0.5, 1e-6);
  const pipeline::Config config = withValues({}, named);
  EXPECT_DOUBLE_EQ(config.ekf.wheels.lateral_sigma_sqrt_m, 0.06);
  EXPECT_EQ(config.mapping.filter.particles, 50);
}

TEST(ParameterTree, KnowsEveryNumberOfTheShippedConfiguration) {
  const ParameterTree tree{pipeline::Config{}};
  EXPECT_EQ(tree.value("mapping.filter.particles"), 15.0);
  EXPECT_EQ(tree.whyNot("mapping.filter.particles"), "");
  EXPECT_THAT(tree.whyNot("ekf.wheels"), HasSubstr("unknown parameter"));
}

}  // namespace
}  // namespace vestibule::tuning

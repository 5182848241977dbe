#include "vestibule/amcl/amcl_names.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "vestibule/core/errors.hpp"

namespace vestibule::amcl {
namespace {

/// A parameter file that is gone after the test.
class File {
 public:
  explicit File(const std::string& text)
      : path_((std::filesystem::temp_directory_path() /
               (std::string("amcl_") +
                testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml"))
                  .string()) {
    std::ofstream(path_) << text;
  }
  ~File() { std::filesystem::remove(path_); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

TEST(AmclNames, ReadsAFileOfNav2) {
  const File file(
      "amcl:\n  ros__parameters:\n    alpha1: 0.04\n    alpha3: 0.09\n    sigma_hit: 0.2\n"
      "    max_beams: 60\n    pf_z: 0.99\n    do_beamskip: false\n    update_min_d: 0.25\n"
      "    robot_model_type: \"nav2_amcl::OmniMotionModel\"\n    tf_broadcast: true\n"
      "    set_initial_pose: true\n    initial_pose: {x: 1.0, y: -2.0, yaw: 0.5}\n    nonsense: "
      "3\n");
  AmclParams params;
  const AmclNames names = applyAmclFile(file.path(), params);
  EXPECT_NEAR(params.motion.rot_per_rot, 0.2, 1e-12);  // a variance there, a sigma here
  EXPECT_NEAR(params.motion.trans_per_trans, 0.3, 1e-12);
  EXPECT_EQ(params.motion.model, MotionModel::kOmni);
  EXPECT_EQ(params.field.sigma_hit_m, 0.2);
  EXPECT_EQ(params.field.max_beams, 60);
  EXPECT_NEAR(params.kld.delta, 0.01, 1e-12);
  EXPECT_FALSE(params.beam_skipping.enabled);
  EXPECT_EQ(params.update_min_d_m, 0.25);
  ASSERT_TRUE(names.T_map_base_init);
  EXPECT_EQ(names.T_map_base_init->y, -2.0);
  EXPECT_EQ(names.ignored, std::vector<std::string>{"tf_broadcast"});
  EXPECT_EQ(names.unknown, std::vector<std::string>{"nonsense"});
}

TEST(AmclNames, KnowsTheNamesOfRos1) {
  const File file("odom_alpha2: 0.01\nkld_err: 0.02\nkld_z: 2.326\nlaser_z_hit: 0.95\n");
  AmclParams params;
  const AmclNames names = applyAmclFile(file.path(), params);
  EXPECT_NEAR(params.motion.rot_per_trans, 0.1, 1e-12);
  EXPECT_EQ(params.kld.epsilon, 0.02);
  EXPECT_NEAR(params.kld.delta, 0.01, 1e-4);  // a quantile this time
  EXPECT_EQ(params.field.z_hit, 0.95);
  EXPECT_EQ(names.applied.size(), 4U);
}

TEST(AmclNames, NamesTheLineOfWhatIsWrong) {
  AmclParams params;
  const File word("alpha1: 0.2\nsigma_hit: wide\n");
  try {
    (void)applyAmclFile(word.path(), params);
    FAIL();
  } catch (const ConfigError& e) {
    EXPECT_EQ(e.what(), word.path() + ":2: sigma_hit: must be a number");
  }
  EXPECT_THROW((void)applyAmclFile("/nowhere.yaml", params), InputError);
}

}  // namespace
}  // namespace vestibule::amcl

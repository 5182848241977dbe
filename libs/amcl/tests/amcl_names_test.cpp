#include "vestibule/amcl/amcl_names.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "amcl_names_target.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::amcl {
namespace {

using testing::HasSubstr;

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
  EXPECT_EQ(names.ignored.size(), 1U);
  EXPECT_EQ(names.ignored.at("no ROS here"), std::vector<std::string>{"tf_broadcast"});
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

TEST(AmclNames, ReadsALaunchFileOfRos1) {
  const File file(
      "<?xml version=\"1.0\"?>\n<launch>\n  <arg name=\"x\" default=\"0.5\"/>\n"
      "  <node pkg=\"map_server\" type=\"map_server\" name=\"m\"><param name=\"kld_err\" "
      "value=\"0.9\"/></node>\n"
      "  <node pkg=\"amcl\" type=\"amcl\" name=\"amcl\">\n"
      "    <param name=\"odom_model_type\" value=\"omni-corrected\"/>\n"
      "    <param name=\"min_particles\" value=\"300\"/>\n"
      "    <param name=\"initial_pose_x\" value=\"$(arg x)\"/>\n  </node>\n</launch>\n");
  AmclParams params;
  const AmclNames names = applyAmclFile(file.path(), params);
  EXPECT_EQ(names.applied.size(), 3U);
  EXPECT_EQ(params.motion.model, MotionModel::kOmni);
  EXPECT_EQ(params.kld.min_particles, 300);
  EXPECT_EQ(params.kld.epsilon, AmclParams().kld.epsilon);
  ASSERT_TRUE(names.T_map_base_init);
  EXPECT_EQ(names.T_map_base_init->x, 0.5);
}

TEST(AmclNames, AStartPoseIsSetOnlyWhereTheFileWantsIt) {
  AmclParams params;
  const File off("set_initial_pose: false\ninitial_pose: {x: 3.0, y: 1.0}\n");
  EXPECT_FALSE(applyAmclFile(off.path(), params).T_map_base_init);
  const File dotted("initial_pose.x: 3.0\n");
  EXPECT_TRUE(applyAmclFile(dotted.path(), params).T_map_base_init);
}

TEST(AmclNames, NamesTheLineOfWhatIsWrong) {
  const auto error = [](const std::string& text) {
    const File file(text);
    AmclParams params;
    try {
      (void)applyAmclFile(file.path(), params);
    } catch (const ConfigError& e) {
      const std::string what = e.what();
      return what.substr(file.path().size());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(error("alpha1: 0.2\nsigma_hit: wide\n"), ":2: sigma_hit: must be a number");
  EXPECT_EQ(
      error("alpha1: 0.2\nsigma_hit: 0\n"),
      ":2: sigma_hit = 0 is amcl.likelihood_field.sigma_hit_m = 0: must be > 0");
  EXPECT_THAT(error("pf_z: 0\n"), HasSubstr(":1: pf_z = 0 is amcl.kld.delta = 1: must be"));
  EXPECT_THAT(error("max_particles: 1e12\n"), HasSubstr(":1: max_particles = 1e12 is amcl.kld"));
  EXPECT_EQ(error("min_particles: 8000\nmax_particles: 9000\n"), "accepted");
  EXPECT_THAT(error("min_particles: 900\nmax_particles: 100\n"), HasSubstr("must not exceed"));
  EXPECT_EQ(error("do_beamskip: maybe\n"), ":1: do_beamskip: must be true or false");
  EXPECT_THAT(error("robot_model_type: [1]\n"), HasSubstr(":1: robot_model_type = "));
  EXPECT_EQ(error("initial_pose:\n  x: .nan\n"), ":2: initial_pose.x: must be a number");
  EXPECT_THAT(error("initial_pose: 3\n"), HasSubstr(":1: initial_pose: must have x, y"));
  EXPECT_EQ(error("kld_err: 0.1\npf_err: 0.1\n"), ":2: pf_err: given twice");
  EXPECT_THAT(error("planner:\n  x: 3\n"), HasSubstr(": no parameter of AMCL in it"));
  EXPECT_THAT(
      error("<launch><node pkg=\"amcl\"><param name=\"kld_err\" value=\"$(arg "
            "e)\"/></node></launch>"),
      HasSubstr(":1: $(arg e): only arguments"));
  EXPECT_THAT(error("<launch><node pkg=\"amcl\">\n"), HasSubstr("not a sound launch file"));
  AmclParams params;
  EXPECT_THROW((void)applyAmclFile("/nowhere.yaml", params), InputError);
}

/// Any exception but a complaint of our own type fails the test.
TEST(AmclNames, AreComplainedAboutOrReadWhereverTheFileEnds) {
  int n = 0;
  for (const auto& entry : std::filesystem::directory_iterator(
           std::filesystem::path(VESTIBULE_SOURCE_DIR) / "libs/amcl/fuzz/corpus/amcl_names")) {
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    for (std::size_t size = 0; size <= bytes.size(); ++size) {
      EXPECT_NO_THROW(fuzz::readAmclNames(bytes.substr(0, size)))
          << entry.path() << " cut at " << size;
    }
    ++n;
  }
  EXPECT_GE(n, 10);
}

}  // namespace
}  // namespace vestibule::amcl

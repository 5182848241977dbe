// vestibule sim: recordings of scripted drives.

#include "cli_fixture.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::test {
namespace {

using testing::HasSubstr;

class Sim : public Cli {};

TEST_F(Sim, RecordsTheSameBytesForTheSameSeed) {
  for (const std::string name : {"a", "b"}) {
    const CommandResult result =
        run({"sim", "--scenario", "in_out_in", "--seed", "3", "--record", path(name + ".rawlog")});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
  }
  EXPECT_EQ(readFile(path("a.rawlog")), readFile(path("b.rawlog")));
  EXPECT_EQ(readFile(path("a.truth.tum")), readFile(path("b.truth.tum")));
  EXPECT_GT(io::readTum(path("a.truth.tum")).size(), 1000U);
  const CommandResult info = run({"info", path("a.rawlog")});
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_THAT(info.out, HasSubstr("LASER"));
  EXPECT_THAT(info.out, HasSubstr("GNSS"));
}

TEST_F(Sim, LeavesAFolderWithAReport) {
  const CommandResult result = run({"sim", "--scenario", "straight_door", "--out", path("out")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(
      finalFiles(path("out")),
      testing::IsSupersetOf(
          {"recording.rawlog",
           "truth.tum",
           "trajectory.tum",
           "summary.json",
           "map.png",
           "scenario.resolved.yaml",
           "site.yaml",
           "report.html"}));
}

TEST_F(Sim, RecordsIntoTheFolderAndBesideIt) {
  const CommandResult result =
      run({"sim", "--scenario", "open_sky", "--out", path("out"), "--record", path("a.rawlog")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(readFile(path("a.rawlog")), readFile(path("out/recording.rawlog")));
  EXPECT_EQ(readFile(path("a.truth.tum")), readFile(path("out/truth.tum")));
}

TEST_F(Sim, SaysWhatIsWrong) {
  const CommandResult unknown =
      run({"sim", "--scenario", "open_skyy", "--record", path("a.rawlog")});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean open_sky?"));
  const CommandResult nowhere = run({"sim", "--scenario", "open_sky"});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("give --record FILE.rawlog or --out FOLDER"));
  const CommandResult list = run({"sim", "--list"});
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_THAT(list.out, HasSubstr("covered_passage"));
}

}  // namespace
}  // namespace vestibule::test

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <sstream>

#include "matchers.hpp"
#include "temp_files.hpp"
#include "vestibule/io/event_log.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/recording_info.hpp"
#include "vestibule/io/run_directory.hpp"
#include "vestibule/io/simple_map.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::io {
namespace {

namespace fs = std::filesystem;
using grid::Cell;
using testing::HasSubstr;

// --- trajectories --------------------------------------------------------------------------------

TEST(Tum, RoundTrip) {
  const StampedPose pose{{976052857337284123}, Pose3(1.25, -2.5, 0.125, 2.0, 0.1, -0.2)};
  const std::string line = formatTumLine(pose);
  EXPECT_EQ(line.substr(0, 20), "976052857.337284123 ");
  const auto back = readTum(writeFile(testFolder() / "a.tum", "# t x y z\n" + line));
  ASSERT_EQ(back.size(), 1U);
  EXPECT_EQ(back[0].stamp, pose.stamp);
  EXPECT_NEAR(back[0].T.x, 1.25, 1e-9);
  EXPECT_NEAR(back[0].T.yaw, 2.0, 1e-8);
  EXPECT_NEAR(back[0].T.pitch, 0.1, 1e-8);
  EXPECT_NEAR(back[0].T.roll, -0.2, 1e-8);
}

TEST(Tum, OneSpellingPerPose) {
  const StampedPose minus{{0}, Pose3(-0.0, -1e-13, 0.0, -1e-13, 0.0, 0.0)};
  EXPECT_EQ(
      formatTumLine(minus),
      "0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 "
      "1.000000000\n");
}

TEST(Tum, BadLinesNameThePlace) {
  const auto folder = testFolder();
  const auto error = [&](const std::string& text) {
    try {
      (void)readTum(writeFile(folder / "a.tum", text));
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const std::string good = "1 0 0 0 0 0 0 1\n";
  EXPECT_EQ(error(good), "");
  EXPECT_THAT(error(good + "2 0 0 0\n"), HasSubstr("a.tum:2: 4 columns"));
  EXPECT_THAT(error(good + "2 0 0 nan 0 0 0 1\n"), HasSubstr("a.tum:2: column 4 is 'nan'"));
  EXPECT_THAT(error(good + "2 0 0 0 0 0 0 0\n"), HasSubstr("quaternion norm 0"));
  EXPECT_THAT(error("x 0 0 0 0 0 0 1\n"), HasSubstr("time 'x'"));
  EXPECT_THAT(error("# nothing\n"), HasSubstr("no poses"));
  EXPECT_THAT(error(""), HasSubstr("empty"));
}

// --- run folder ----------------------------------------------------------------------------------

std::vector<std::string> filesIn(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    names.push_back(fs::relative(entry.path(), folder).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

TEST(RunDirectory, CommitGivesFinalNames) {
  const auto folder = testFolder() / "deep" / "out";
  {
    RunDirectory run(folder);
    writeFile(run.stage("summary.json"), "{}");
    writeFile(run.stage("photos/one.png"), "png");
    (void)run.stage("never-written.txt");
    EXPECT_FALSE(fs::exists(folder / "summary.json"));
    run.commit();
  }
  EXPECT_THAT(filesIn(folder), testing::ElementsAre("photos", "photos/one.png", "summary.json"));
}

TEST(RunDirectory, AnAbandonedRunLeavesNothingAndKeepsTheOldResults) {
  const auto folder = testFolder();
  writeFile(folder / "trajectory.tum", "old");
  try {
    RunDirectory run(folder);
    writeFile(run.stage("trajectory.tum"), "half of the n");
    throw InputError("broken recording");
  } catch (const InputError&) {
  }
  EXPECT_THAT(filesIn(folder), testing::ElementsAre("trajectory.tum"));
  EXPECT_EQ(readFile(folder / "trajectory.tum"), "old");
}

TEST(RunDirectory, TheNextRunClearsWhatAKilledOneLeft) {
  const auto folder = testFolder();
  // No process has the largest id: the kernel's limit is far below.
  fs::create_directories(folder / ".partial-2147483647");
  fs::create_directories(folder / (".partial-" + std::to_string(::getppid())));
  {
    RunDirectory run(folder);
    EXPECT_FALSE(fs::exists(folder / ".partial-2147483647"));
    EXPECT_TRUE(fs::exists(folder / (".partial-" + std::to_string(::getppid()))));
  }
  EXPECT_TRUE(fs::exists(folder)) << "a folder that was there before must stay";
}

TEST(RunDirectory, RefusesWhatItCannotWrite) {
  const auto folder = testFolder();
  writeFile(folder / "file", "");
  EXPECT_THROW(RunDirectory(folder / "file"), ConfigError);
  EXPECT_THROW(RunDirectory(folder / "file/below"), ConfigError);
  RunDirectory run(folder);
  EXPECT_THROW((void)run.stage("../outside"), ConfigError);
  EXPECT_THROW((void)run.stage("/outside"), ConfigError);
  EXPECT_THROW((void)run.stage(""), ConfigError);
}

// --- events --------------------------------------------------------------------------------------

TEST(EventLog, WritesOneObjectPerLine) {
  std::ostringstream out;
  EventLog log(out);
  log.onUpdate({{1500000000}, "gnss", Decision::kGated, "chi2 \"far\"", 12.5, NAN, 2});
  const std::vector<Pose2> particles(3);
  const std::vector<double> weights(3, 1.0 / 3.0);
  log.onParticles({{2000000000}, particles, weights, 3.0, 0.5});
  log.onMode({{3000000000}, Mode::kOutdoor, Mode::kIndoor, "roof", {{"sigma_m", 0.1}}});
  log.onMap({{4000000000}, MapEvent::Kind::kLoaded, "hall", 49.5});
  const std::string text = out.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
  EXPECT_THAT(text, HasSubstr("{\"t\":\"1.500000000\",\"type\":\"update\",\"sensor\":\"gnss\""));
  EXPECT_THAT(text, HasSubstr("\"reason\":\"chi2 \\\"far\\\"\",\"nis\":12.5,\"gate\":null"));
  EXPECT_THAT(text, HasSubstr("\"count\":3"));
  EXPECT_THAT(text, HasSubstr("\"values\":{\"sigma_m\":0.1}"));
  EXPECT_THAT(
      text,
      HasSubstr("{\"t\":\"4.000000000\",\"type\":\"map\",\"kind\":\"loaded\",\"map\":\"hall\","
                "\"distance_m\":49.5}"));
}

// --- maps ----------------------------------------------------------------------------------------

constexpr const char* kMapYaml =
    "image: m.pgm\nresolution: 0.05\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n";

// Top row: occupied, free, unknown; bottom row: free, free, occupied.
const std::string kPgm =
    std::string("P5\n3 2\n255\n") + '\x00' + '\xfe' + '\xcd' + "\xfe\xfe" + '\x00';

std::string mapError(const std::string& path) {
  try {
    (void)loadMap(path);
  } catch (const InputError& e) {
    return std::string("InputError ") + e.what();
  } catch (const ConfigError& e) {
    return std::string("ConfigError ") + e.what();
  }
  return {};
}

TEST(MapIo, ReadsAMapServerMap) {
  const auto folder = testFolder();
  writeFile(folder / "m.pgm", kPgm);
  const auto map = loadMap(writeFile(folder / "m.yaml", kMapYaml));
  EXPECT_EQ(map.width(), 3);
  EXPECT_EQ(map.height(), 2);
  EXPECT_EQ(map.at({1.02, 2.07}), Cell::kOccupied);
  EXPECT_EQ(map.at({1.12, 2.07}), Cell::kUnknown);
  EXPECT_EQ(map.at({1.12, 2.02}), Cell::kOccupied);
  EXPECT_EQ(map.at({1.07, 2.02}), Cell::kFree);
}

/// A map of one row of pixels in the given mode.
std::vector<Cell> rowOf(
    const std::string& mode, const std::string& image, const std::string& bytes, bool negate) {
  const auto folder = testFolder();
  writeFile(folder / image, bytes);
  const auto map = loadMap(writeFile(
      folder / "row.yaml",
      "image: " + image + "\nmode: " + mode + "\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: " +
          (negate ? "1" : "0") + "\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"));
  std::vector<Cell> cells;
  for (int ix = 0; ix < map.width(); ++ix) cells.push_back(map.cell(ix, 0));
  return cells;
}

constexpr Cell kF = Cell::kFree, kO = Cell::kOccupied, kU = Cell::kUnknown;
using testing::ElementsAre;

TEST(MapIo, ModesDecideAsMapServerDoes) {
  const std::string shades = "P2 6 1 255  0 89 90 191 192 255\n";
  EXPECT_THAT(rowOf("trinary", "r.pgm", shades, false), ElementsAre(kO, kO, kU, kU, kF, kF));
  EXPECT_THAT(rowOf("trinary", "r.pgm", shades, true), ElementsAre(kF, kU, kU, kO, kO, kO));
  // 191 is 0.251 occupied: 0.2 % of the way from free to occupied, which map_server rounds to 0.
  EXPECT_THAT(rowOf("Scale", "r.pgm", shades, false), ElementsAre(kO, kO, kU, kF, kF, kF));
  const std::string percentages = "P2 6 1 255  0 25 26 65 100 101";
  EXPECT_THAT(rowOf("raw", "r.pgm", percentages, false), ElementsAre(kF, kF, kU, kO, kO, kU));
  EXPECT_THAT(rowOf("raw", "r.pgm", percentages, true), ElementsAre(kF, kF, kU, kO, kO, kU));
}

TEST(MapIo, ASaversUnknownStaysUnknown) {
  EXPECT_THAT(
      rowOf("trinary", "r.pgm", "P2 4 1 255  0 205 254 255", false), ElementsAre(kO, kU, kF, kF));
  // With any other value 205 is a shade like all.
  EXPECT_THAT(
      rowOf("trinary", "r.pgm", "P2 4 1 255  0 205 254 206", false), ElementsAre(kO, kF, kF, kF));
  EXPECT_THAT(rowOf("scale", "r.pgm", "P2 3 1 255  0 205 254", false), ElementsAre(kO, kF, kF));
  const auto folder = testFolder();
  writeFile(folder / "m.pgm", kPgm);
  std::vector<std::string> notes;
  (void)loadMap(writeFile(folder / "m.yaml", kMapYaml), &notes);
  EXPECT_TRUE(notes.empty());
  std::string nav2 = kMapYaml;
  nav2.replace(nav2.find("0.196"), 5, "0.25");
  (void)loadMap(writeFile(folder / "n.yaml", nav2), &notes);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], HasSubstr("n.yaml:6: "));
  EXPECT_THAT(notes[0], HasSubstr("taken as unknown (free_thresh: 0.196 says so)"));
}

TEST(MapIo, KeysOfOtherProgramsAreIgnoredAndSaid) {
  const auto folder = testFolder();
  writeFile(folder / "m.pgm", kPgm);
  std::vector<std::string> notes;

  const auto map = loadMap(
      writeFile(
          folder / "m.yaml",
          std::string(kMapYaml) +
              "map_id: \"7\"\ncost_translation_table: a.yaml\nlayers: {a: [1]}\n"),
      &notes);

  EXPECT_GT(map.width(), 0);
  ASSERT_EQ(notes.size(), 3U);
  EXPECT_THAT(notes[0], HasSubstr("m.yaml:7: map_id: "));
  EXPECT_THAT(notes[2], HasSubstr("layers"));
}

TEST(MapIo, APgmsWhiteIsItsOwn) {
  EXPECT_THAT(
      rowOf("trinary", "r.pgm", "P2\n# by hand\n3 1\n100\n0 50 100", false),
      ElementsAre(kO, kU, kF));
  EXPECT_THAT(
      rowOf("trinary", "r.pgm", std::string("P5 3 1 1000\n\0\0\1\xf4\3\xe8", 18), false),
      ElementsAre(kO, kU, kF));
}

TEST(MapIo, AlphaIsOneMoreColourInTrinaryAndUnknownInScale) {
  // Grey and alpha: opaque white, opaque black, clear white, clear black (PNG of one row).
  const std::string png = std::string("\x89PNG\r\n\x1a\n", 8) +
                          std::string(
                              "\000\000\000\015\111\110\104\122\000\000\000\004\000\000\000\001"
                              "\010\004\000\000\000\123\065\307\106\000\000\000\017\111\104\101"
                              "\124\170\234\143\370\377\237\001\210\030\030\000\027\361\003\375"
                              "\136\324\174\104\000\000\000\000\111\105\116\104\256\102\140\202",
                              64);
  EXPECT_THAT(rowOf("trinary", "r.png", png, false), ElementsAre(kF, kO, kU, kO));
  EXPECT_THAT(rowOf("scale", "r.png", png, false), ElementsAre(kF, kO, kU, kU));
}

TEST(MapIo, ImagesCutShortSaySoAndNothingElse) {
  const auto folder = testFolder();
  const std::string yaml = writeFile(folder / "m.yaml", kMapYaml);
  const auto error = [&](const std::string& image) {
    writeFile(folder / "m.pgm", image);
    testing::internal::CaptureStderr();
    const std::string text = mapError(yaml);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    return text;
  };
  EXPECT_THAT(error(kPgm.substr(0, kPgm.size() - 1)), HasSubstr("m.yaml:1: image: "));
  EXPECT_THAT(error(kPgm.substr(0, kPgm.size() - 1)), HasSubstr("cut short, 5 of 6 pixels"));
  EXPECT_THAT(error("P2\n3 2\n255\n0 254 205 254  254  "), HasSubstr("cut short, 5 of 6 pixels"));
  EXPECT_THAT(error("P2\n3 2\n"), HasSubstr("not a PGM header"));
  EXPECT_THAT(error("P5\n-3 2\n255\n"), HasSubstr("not a PGM header"));
  EXPECT_THAT(error("P5\n999999 999999\n255\nabc"), HasSubstr("cut short, 3 of 999998000001"));
  EXPECT_THAT(error("\x89PNG\r\n\x1a\n"), HasSubstr("cut short; export the map again"));
}

TEST(MapIo, TurnsWithTheOriginsYaw) {
  const auto folder = testFolder();
  writeFile(folder / "m.pgm", kPgm);
  std::string yaml = kMapYaml;
  yaml.replace(yaml.find("2.0, 0.0]"), 9, "2.0, 1.5707963267948966]");
  const auto map = loadMap(writeFile(folder / "m.yaml", yaml));
  // A quarter turn about the lower left corner: image x becomes map y.
  EXPECT_EQ(map.at({1.0 - 0.02, 2.0 + 0.12}), Cell::kOccupied);
  EXPECT_EQ(map.at({1.0 - 0.07, 2.0 + 0.02}), Cell::kOccupied);
  EXPECT_EQ(map.at({1.0 - 0.02, 2.0 + 0.02}), Cell::kFree);
}

TEST(MapIo, SavedMapsComeBackExactly) {
  const auto folder = testFolder();
  std::vector<Cell> cells;
  for (int i = 0; i < 7 * 5; ++i) cells.push_back(static_cast<Cell>(i * 5 % 3));
  const auto map =
      grid::OccupancyMap::fromCells(7, 5, 0.05, {-1.234567, 3.3}, cells, {0.1, 0.2, 0.7});
  saveMapServer(map, (folder / "a.yaml").string(), (folder / "a.pgm").string());
  EXPECT_THAT(readFile(folder / "a.yaml"), HasSubstr("resolution: 0.05\n"));
  const auto back = loadMap((folder / "a.yaml").string());
  ASSERT_EQ(back.width(), 7);
  for (int i = 0; i < 35; ++i)
    EXPECT_EQ(back.cell(i % 7, i / 7), cells[static_cast<std::size_t>(i)]);
  const Pose2 corner_in = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  const Pose2 corner_out = compose(back.T_map_grid(), Pose2{back.corner().x, back.corner().y, 0.0});
  EXPECT_THAT(corner_out, poseNear(corner_in, 1e-12, 1e-12));
  saveMapServer(back, (folder / "b.yaml").string(), (folder / "b.pgm").string(), "a.pgm");
  EXPECT_EQ(readFile(folder / "b.yaml"), readFile(folder / "a.yaml"));
  EXPECT_EQ(readFile(folder / "b.pgm"), readFile(folder / "a.pgm"));
}

TEST(MapIo, AGeoreferenceIsWrittenAndDoesNotDisturb) {
  const auto folder = testFolder();
  const auto map =
      grid::OccupancyMap::fromCells(2, 1, 0.05, {0.0, 0.0}, {Cell::kFree, Cell::kOccupied});
  MapGeoreference g;
  g.datum = {47.5, 8.25, 410.0};
  g.T_map_grid = {10.0, -20.5, 0.5};
  g.cov.diagonal() << 0.04, 0.09, 0.0001;
  saveMapServer(map, (folder / "g.yaml").string(), (folder / "g.pgm").string(), {}, g);
  EXPECT_THAT(
      readFile(folder / "g.yaml"),
      testing::AllOf(
          HasSubstr("datum: [47.5, 8.25, 410]"),
          HasSubstr("T_map_grid: [10, -20.5, 28.6478"),
          HasSubstr("    - [0, 0.09, 0]")));
  EXPECT_EQ(loadMap((folder / "g.yaml").string()).count(Cell::kOccupied), 1U);
  const auto back = loadGeoreference((folder / "g.yaml").string());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->datum.lat_deg, 47.5);
  EXPECT_THAT(back->T_map_grid, poseNear(g.T_map_grid, 1e-12, 1e-12));
  EXPECT_EQ(back->cov, g.cov);
  saveMapServer(map, (folder / "plain.yaml").string(), (folder / "plain.pgm").string());
  EXPECT_FALSE(loadGeoreference((folder / "plain.yaml").string()));
  EXPECT_FALSE(loadGeoreference("map.gridmap"));
  writeFile(folder / "bad.yaml", readFile(folder / "g.yaml") + "  datums: [1, 2, 3]\n");
  EXPECT_THAT(mapError((folder / "bad.yaml").string()), HasSubstr("georeference.datums"));
  g.cov(1, 1) = -0.09;
  saveMapServer(map, (folder / "bad.yaml").string(), (folder / "bad.pgm").string(), {}, g);
  EXPECT_THAT(mapError((folder / "bad.yaml").string()), HasSubstr("negative variances"));
}

TEST(SimpleMap, ComesBackWithSessionsAndPoses) {
  const auto folder = testFolder();
  MapFrame frame;
  frame.T_map_base = {1.25, -2.5, 0.75};
  frame.session = 3;
  frame.scan.stamp = {1'700'000'000'123'456'700};
  frame.scan.angle_min_rad = -1.0;
  frame.scan.angle_step_rad = 0.5;
  frame.scan.range_max_m = 20.0;
  frame.scan.ranges_m = {1.0F, 2.0F, 30.0F, 4.0F};
  frame.scan.T_base_laser = {0.2, 0.1, 0.3};
  saveSimpleMap((folder / "m.simplemap").string(), {frame, frame});
  const auto back = readSimpleMap((folder / "m.simplemap").string());
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[1].session, 3);
  EXPECT_EQ(back[1].scan.stamp, frame.scan.stamp);
  EXPECT_THAT(back[1].T_map_base, poseNear(frame.T_map_base, 1e-9, 1e-9));
  // Beams point where they did, whichever way their angles are split.
  for (const std::size_t i : {0U, 1U, 3U}) {
    EXPECT_NEAR(
        back[1].scan.T_base_laser.phi + back[1].scan.angle(i),
        frame.scan.T_base_laser.phi + frame.scan.angle(i),
        1e-6);
    EXPECT_EQ(back[1].scan.ranges_m[i], frame.scan.ranges_m[i]);
  }
  EXPECT_FALSE(back[1].scan.valid(2));
  EXPECT_THROW((void)readSimpleMap((folder / "none.simplemap").string()), InputError);
}

TEST(MapIo, BadMapsNameThePlace) {
  const auto folder = testFolder();
  writeFile(folder / "m.pgm", kPgm);
  const auto with = [&](const std::string& yaml) {
    return mapError(writeFile(folder / "m.yaml", yaml));
  };
  EXPECT_EQ(with(kMapYaml), "");
  EXPECT_THAT(
      with("image: m.pgm\norigin: [0, 0, 0]\n"),
      testing::AllOf(HasSubstr("ConfigError"), HasSubstr("m.yaml:"), HasSubstr("resolution")));
  EXPECT_THAT(
      with(std::string(kMapYaml) + "occupied_tresh: 0.5\n"),
      testing::AllOf(HasSubstr("m.yaml:7"), HasSubstr("did you mean occupied_thresh")));
  EXPECT_THAT(
      with("image: m.pgm\nresolution: -1\norigin: [0, 0]\n"),
      testing::AllOf(HasSubstr("ConfigError"), HasSubstr("m.yaml:2")));
  EXPECT_THAT(
      with("resolution: 0.05\nimage: gone.pgm\norigin: [0, 0, 0]\n"),
      testing::AllOf(HasSubstr("InputError"), HasSubstr("m.yaml:2"), HasSubstr("gone.pgm")));
  writeFile(folder / "bad.png", "no image");
  EXPECT_THAT(
      with("image: bad.png\nresolution: 0.05\norigin: [0, 0, 0]\n"),
      testing::AllOf(HasSubstr("InputError"), HasSubstr("bad.png"), HasSubstr("not a readable")));
  // What OpenCV says of a cut off image stays out of the error.
  writeFile(folder / "cut.pgm", "P5\n4 4\n255\nabc");
  testing::internal::CaptureStderr();
  EXPECT_THAT(
      with("image: cut.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"),
      testing::AllOf(HasSubstr("InputError"), HasSubstr("cut.pgm"), HasSubstr("cut short")));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_THAT(with("image: [\n"), HasSubstr("ConfigError"));
  EXPECT_THAT(mapError((folder / "none.yaml").string()), HasSubstr("none.yaml"));
  EXPECT_THAT(
      mapError(writeFile(folder / "a.gridmap", "garbage")),
      testing::AllOf(HasSubstr("InputError"), HasSubstr("a.gridmap")));
  EXPECT_THAT(mapError(writeFile(folder / "a.simplemap.gz", "")), HasSubstr("empty"));
  EXPECT_THAT(mapError(writeFile(folder / "a.txt", "x")), HasSubstr("unknown kind of map"));
}

// --- info ----------------------------------------------------------------------------------------

TEST(RecordingInfo, FindsWhatLooksWrong) {
  // GIVEN ten odometry lines at 10 Hz, one of them stamped before its predecessor
  std::string text;
  for (int i = 0; i < 10; ++i) {
    const double t = 100.0 + 0.1 * (i == 5 ? 3.5 : i);
    text += "ODOM " + std::to_string(0.5 * i) + " 0 0 0 0 0 " + std::to_string(t) + " host 0\n";
  }
  double last_progress = -1.0;
  const RecordingInfo info = inspectRecording(
      writeFile(testFolder() / "a.log", text), {}, [&](double p) { last_progress = p; });
  ASSERT_EQ(info.sources.size(), 1U);
  EXPECT_EQ(info.sources[0].count, 9U);
  EXPECT_NEAR(info.sources[0].rate_hz.value(), 10.0, 0.01);
  EXPECT_EQ(info.sources[0].backward_stamps, 1U);
  EXPECT_NEAR(info.sources[0].largest_gap_s, 0.25, 1e-6);
  EXPECT_EQ(info.sources[0].detail, "path 4.5 m");
  ASSERT_EQ(info.findings.size(), 1U);
  EXPECT_EQ(info.findings[0].first_record, 6U);
  EXPECT_THAT(info.toText(), HasSubstr("stamps run backwards: 1 (first at 6)"));
  EXPECT_THAT(info.toJson(), HasSubstr("\"backward_stamps\": 1"));
  EXPECT_LT(last_progress, 0.0) << "progress is for long recordings";
}

}  // namespace
}  // namespace vestibule::io

// graupel view over its sockets: who gets what, and that the bytes are those of the runs.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "io/trajectory/trajectory_file.h"
#include "tests/viewer/client.h"
#include "tests/viewer/frame_reader.h"

namespace graupel::test {
namespace {

class View : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<Folder>();
    made_->write("small.json", small_scene());
    made_->write("tiny.json", small_scene("",
                                          "{ \"shape\": \"box\", \"size\": [0.1, 0.1, 0.1], \"position\": [0.5, "
                                          "0.5, 0.5], \"material\": \"water\" }"));
    for (const std::string name : {"small", "tiny"}) {
      const Outcome made =
          graupel("simulate " + made_->file(name + ".json") + " -o " + made_->file(name + ".h5") + " --device cpu");
      ASSERT_EQ(made.exit_code, 0) << made.output;
    }
  }
  static void TearDownTestSuite() { made_.reset(); }
  static std::string file(const std::string& name) { return made_->file(name); }

  static ReadFrame frame_of(const std::string& bytes) {
    return read_frame(std::as_bytes(std::span(bytes.data(), bytes.size())));
  }
  static std::string range_of(std::size_t k, std::size_t record) {
    return "Range: bytes=" + std::to_string(k * record) + "-" + std::to_string((k + 1) * record - 1) + "\r\n";
  }
  static void expect_frame(const ReadFrame& served, const ParticleFrame& frame) {
    ASSERT_EQ(served.steps.size(), 3 * frame.position.size());
    EXPECT_NEAR(served.time, frame.time, 1e-6);
    for (std::size_t i = 0; i < frame.position.size(); ++i)
      for (int d = 0; d < 3; ++d)
        ASSERT_LE(std::abs(served.position(i)[d] - frame.position[i][d]), 0.5f * served.step[d] + 2e-7f) << i;
  }
  static nlohmann::json side_of(const std::string& json, std::size_t side) {
    return nlohmann::json::parse(json).at("sides").at(side);
  }
  /// Of side 0, once it is in this state.
  static nlohmann::json wait_for_state(Client& client, const std::string& root, const std::string& state) {
    nlohmann::json status;
    for (int tries = 0; tries < 600; ++tries) {
      status = side_of(client.ask(root + "status.json").body, 0);
      if (status.at("state") == state) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    EXPECT_EQ(status.at("state"), state);
    return status;
  }

  static inline std::unique_ptr<Folder> made_;
};

TEST_F(View, OnlyTheSecretAddressIsAnswered) {
  ViewProgram program({file("small.h5")});
  Client client(program.port());
  const std::string root = program.root(), port = std::to_string(program.port());
  ASSERT_EQ(root.size(), 34u);
  EXPECT_EQ(client.ask(root).status, 200);
  EXPECT_NE(client.ask(root).body.find("<canvas"), std::string::npos);
  EXPECT_NE(client.ask(root).head.find("Content-Security-Policy: default-src 'self'"), std::string::npos);
  std::string wrong = root;
  wrong[5] = wrong[5] == 'a' ? 'b' : 'a';
  for (const std::string& path : {std::string("/"), std::string("/facts.json"), std::string("/0/frames"), wrong,
                                  wrong + "facts.json", root.substr(0, 20) + "/facts.json"})
    EXPECT_EQ(client.ask(path).status, 403) << path;
  for (const std::string& host : {std::string("evil.example"), "evil.example:" + port, std::string("127.0.0.1"),
                                  "127.0.0.1:" + port + ".evil.example", std::string("127.0.0.1:1")})
    EXPECT_EQ(client.ask(root, "Host: " + host + "\r\n").status, 403) << host;
  EXPECT_EQ(client.ask(root, "Host: localhost:" + port + "\r\n").status, 200);
  for (const std::string& origin : {std::string("null"), std::string("https://evil.example"),
                                    "https://127.0.0.1:" + port, std::string("http://127.0.0.1")})
    EXPECT_EQ(client.ask(root + "facts.json", "Origin: " + origin + "\r\n").status, 403) << origin;
  EXPECT_EQ(client.ask(root + "facts.json", "Origin: http://127.0.0.1:" + port + "\r\n").status, 200);
}

TEST_F(View, NothingButItsRoutesIsServed) {
  ViewProgram program({file("small.h5")});
  Client client(program.port());
  const std::string root = program.root();
  for (const std::string path :
       {"../small.h5", "..%2f..%2fetc/passwd", "../../../../etc/passwd", "/etc/passwd", "small.h5", "1/frames", "0/",
        "0/frames/..", "-1/frames", "00/types", "view.html", "%00"}) {
    const Answer answer = client.ask(root + path);
    EXPECT_EQ(answer.status, 404) << path;
    EXPECT_EQ(answer.body.find("root:"), std::string::npos);
  }
  EXPECT_EQ(client.ask(root + "0/restart", "", "POST").status, 404);  // nothing runs
  EXPECT_EQ(client.ask(root, "", "PUT").status, 405);
  EXPECT_NE(client.ask(root, "", "PUT").head.find("Allow: GET, POST\r\n"), std::string::npos);
  EXPECT_EQ(client.ask(root, "Content-Length: 5\r\n", "POST").status, 413);
  EXPECT_EQ(Client(program.port()).send("GET / HTTP/1.1\r\nHost: " + std::string(20000, 'a')).status, 431);
}

TEST_F(View, FramesAreRangesOfBytes) {
  ViewProgram program({file("small.h5")});
  Client client(program.port());
  const std::string root = program.root();
  const auto facts = side_of(client.ask(root + "facts.json").body, 0);
  const io::TrajectoryReader reader(file("small.h5"));
  const Trajectory run = reader.read(0);
  const auto record = facts.at("record_bytes").get<std::size_t>();
  ASSERT_EQ(record, experiments::frame_record_bytes(run.particle_count(), 0));
  ASSERT_EQ(facts.at("times").size(), run.frame_count());
  for (const std::size_t k : {12, 0, 7, 7, 1}) {
    const Answer answer = client.ask(root + "0/frames", range_of(k, record));
    ASSERT_EQ(answer.status, 206);
    const std::string total = "/" + std::to_string(record * run.frame_count()) + "\r\n";
    EXPECT_NE(answer.head.find(total), std::string::npos) << answer.head;
    expect_frame(frame_of(answer.body), run.frames[k]);
  }
  const Answer whole = client.ask(root + "0/frames");
  EXPECT_EQ(whole.status, 200);
  ASSERT_EQ(whole.body.size(), record * run.frame_count());
  const Answer middle = client.ask(
      root + "0/frames", "Range: bytes=" + std::to_string(record - 10) + "-" + std::to_string(record + 9) + "\r\n");
  EXPECT_EQ(middle.body, whole.body.substr(record - 10, 20));
  const std::string size = std::to_string(whole.body.size());
  const Answer behind = client.ask(root + "0/frames", "Range: bytes=" + size + "-\r\n");
  EXPECT_EQ(behind.status, 416);
  EXPECT_NE(behind.head.find("Content-Range: bytes */" + size + "\r\n"), std::string::npos) << behind.head;
  EXPECT_EQ(client.ask(root + "0/frames", "Range: bytes=0-1,4-5\r\n").status, 416);
  EXPECT_EQ(client.ask(root + "0/types").body, std::string(run.particle_count(), '\5'));
}

TEST_F(View, TwoMaterialsOfALawHaveTheirOwnColours) {
  const std::string scene = made_->write("sands.json", R"({ "name": "sands", "domain": { "dx": 0.03125 }, "frames": 2,
    "materials": { "wet": { "preset": "taichi_sand", "friction_angle": 20 }, "dry": { "preset": "taichi_sand" } },
    "sources": [
      { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.3, 0.3, 0.5], "material": "dry" },
      { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.7, 0.3, 0.5], "material": "wet" } ] })");
  ASSERT_EQ(graupel("simulate " + scene + " -o " + file("sands.h5") + " --device cpu").exit_code, 0);
  const io::TrajectoryReader reader(file("sands.h5"));
  const ParticleFrame start = reader.frames(0, 0, 1).front();
  for (const std::string& shown : {file("sands.h5"), scene}) {
    ViewProgram program({shown});
    Client client(program.port());
    const auto materials = side_of(client.ask(program.root() + "facts.json").body, 0).at("materials");
    ASSERT_EQ(materials.size(), 2u);
    EXPECT_EQ(materials[0].at("name"), "dry");
    EXPECT_EQ(materials[1].at("name"), "wet");
    EXPECT_NE(materials[0].at("color"), materials[1].at("color"));
    const std::string bytes = client.ask(program.root() + "0/types").body;
    ASSERT_EQ(bytes.size(), start.position.size());
    for (std::size_t i = 0; i < bytes.size(); ++i)
      ASSERT_EQ(bytes[i], materials[start.position[i][0] < 0.5f ? 0 : 1].at("type").get<int>()) << i;
  }
}

TEST_F(View, RefinedPointsAreDrawnSmaller) {
  const auto radius_of = [&](const std::string& name, const std::string& options) {
    const std::string made = file(name);
    EXPECT_EQ(
        graupel("rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --frames 1 -o " + made + options)
            .exit_code,
        0);
    ViewProgram program({made});
    Client client(program.port());
    return side_of(client.ask(program.root() + "facts.json").body, 0).at("radius").get<double>();
  };
  const double coarse = radius_of("coarse.h5", "");
  EXPECT_NEAR(radius_of("refined.h5", " --refine 8"), coarse / 2, 0.02 * coarse);
}

TEST_F(View, ASceneRunsAsSimulateDoes) {
  ViewProgram program({file("small.json"), "--device", "cpu"});
  Client client(program.port());
  const std::string root = program.root();
  EXPECT_EQ(wait_for_state(client, root, "done").at("frames"), 13);
  const Trajectory run = io::TrajectoryReader(file("small.h5")).read(0);
  const std::size_t record = experiments::frame_record_bytes(run.particle_count(), 0);
  for (std::size_t k = 0; k <= 12; ++k)
    expect_frame(frame_of(client.ask(root + "0/frames", range_of(k, record)).body), run.frames[k]);
  EXPECT_EQ(client.ask(root + "0/restart", "", "POST").status, 200);
  const auto again = wait_for_state(client, root, "done");
  EXPECT_EQ(again.at("run"), 1);
  const ReadFrame last = frame_of(client.ask(root + "0/frames", range_of(12, record)).body);
  EXPECT_EQ(last.run, 1u);
  expect_frame(last, run.frames[12]);
}

TEST_F(View, ARunPausesAndGoesOn) {
  ViewProgram program({file("small.json"), "--device", "cpu", "--set", "frames=100000"});
  Client client(program.port());
  const std::string root = program.root();
  EXPECT_EQ(client.ask(root + "0/pause", "", "POST").status, 200);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const auto frames = [&] { return wait_for_state(client, root, "paused").at("frames").get<int>(); };
  const int paused_at = frames();
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(frames(), paused_at);
  const std::size_t record = side_of(client.ask(root + "facts.json").body, 0).at("record_bytes");
  EXPECT_EQ(client.ask(root + "0/frames", range_of(static_cast<std::size_t>(paused_at), record)).status, 416);
  EXPECT_EQ(client.ask(root + "0/play", "", "POST").status, 200);
  for (int tries = 0; tries < 200; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (side_of(client.ask(root + "status.json").body, 0).at("frames") > paused_at) break;
  }
  EXPECT_GT(side_of(client.ask(root + "status.json").body, 0).at("frames"), paused_at);
  EXPECT_EQ(program.stop(SIGTERM), 0);  // in the middle of the run
}

TEST_F(View, SignalsEndIt) {
  for (const int signal : {SIGINT, SIGTERM}) {
    ViewProgram program({file("small.h5")});
    Client idle(program.port());
    const int port = program.port();
    EXPECT_EQ(program.stop(signal), 0);
    EXPECT_FALSE(Client(port).connected());
  }
}

TEST_F(View, APortOfTheSystemIsRefusedWithoutItsPermission) {
  int first_of_users = 0;
  std::ifstream("/proc/sys/net/ipv4/ip_unprivileged_port_start") >> first_of_users;
  if (first_of_users <= 80) GTEST_SKIP() << "this machine gives port 80 to every user";
  const std::string rights = ::geteuid() == 0 ? "--bounding-set -net_bind_service --inh-caps -net_bind_service " : "";
  const std::string setpriv = "/usr/bin/setpriv";
  if (run_program(setpriv, rights + "true").exit_code != 0)
    GTEST_SKIP() << "no program can be started without the right to ports below 1024 (needs setpriv)";
  const Outcome refused = run_program(
      setpriv, rights + "/usr/bin/timeout 20 '" GRAUPEL_BINARY_DIR "/graupel' view " + file("small.h5") + " --port 80");
  EXPECT_EQ(refused.exit_code, 2) << refused.output;
  EXPECT_TRUE(refused.says("port 80 cannot be used (Permission denied). Give one from 1024 to 65535"))
      << refused.output;
}

TEST_F(View, SaysWhatIsWrong) {
  ViewProgram program({file("small.h5")});
  const std::string port = std::to_string(program.port());
  const Outcome taken = graupel("view " + file("small.h5") + " --port " + port);
  EXPECT_EQ(taken.exit_code, 2);
  EXPECT_TRUE(taken.says("port " + port + " cannot be used")) << taken.output;
  EXPECT_TRUE(taken.says("leave --port out")) << taken.output;
  for (const std::string out_of_range : {"0", "65536", "-1"}) {
    const Outcome refused = graupel("view " + file("small.h5") + " --port " + out_of_range);
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
    EXPECT_TRUE(refused.says("'" + out_of_range + "' is not usable (allowed: a whole number, 1 to 65535)"))
        << refused.output;
  }
  EXPECT_EQ(graupel("view " + file("none.h5")).exit_code, 3);
  const Outcome missing = graupel("view " + file("none.json"));
  EXPECT_EQ(missing.exit_code, 3) << missing.output;
  EXPECT_TRUE(missing.says("none.json")) << missing.output;
  const Outcome three = graupel("view a.h5 b.h5 c.h5");
  EXPECT_EQ(three.exit_code, 2);
  EXPECT_TRUE(three.says("3 files are given (allowed: 1, or 2 side by side)")) << three.output;
  EXPECT_EQ(graupel("view " + file("small.h5") + " --trajectory 4").exit_code, 2);
  const Outcome set = graupel("view " + file("small.h5") + " --set frames=3");
  EXPECT_TRUE(set.says("no scene (.json) is given")) << set.output;
  const Outcome differ =
      run_program("/usr/bin/timeout", "--preserve-status --foreground -s INT 2 '" GRAUPEL_BINARY_DIR "/graupel' view " +
                                          file("small.h5") + " " + file("tiny.h5"));
  EXPECT_EQ(differ.exit_code, 0) << differ.output;
  EXPECT_TRUE(differ.says("so that no error is shown (it needs the same particles)")) << differ.output;
}

}  // namespace
}  // namespace graupel::test

/// Requests of a live view's page, and recorded sessions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "phyxel/error.hpp"
#include "view/recording.hpp"
#include "view/request.hpp"

namespace phyxel::app {
namespace {

using testing::HasSubstr;

std::string refusal_of(const std::string& text) {
  try {
    parse_request(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Requests, AreWhatTheirTextsSay) {
  EXPECT_EQ(parse_request(R"({"do": "grab", "phyxel": 7})").phyxel, 7);
  const Request move = parse_request(R"({"do": "move", "by": [0.1, -2, 3e-3]})");
  EXPECT_EQ(move.by, (Vec3d{0.1, -2, 3e-3}));
  const Request set = parse_request(R"({"do": "set", "gravity": [0, 0, -1.6], "friction": 0.5})");
  EXPECT_EQ(set.settings.gravity, (Vec3d{0, 0, -1.6}));
  EXPECT_EQ(set.settings.friction, 0.5);
  EXPECT_FALSE(set.settings.stiffness);
  EXPECT_EQ(parse_request(R"({"do": "show", "field": "speed"})").field, "speed");
  EXPECT_EQ(parse_request(R"({"do": "pace", "factor": 0.25})").number, 0.25);
}

TEST(Settings, TakeTheValuesOfLaterOnes) {
  const Settings whole{
      .gravity = Vec3d{0, 0, 1}, .stiffness = 2.0, .damping = 3.0, .friction = 4.0};
  Settings taken;
  taken.take(whole);
  EXPECT_EQ(taken, whole);
  taken.take({});
  EXPECT_EQ(taken, whole);
  taken.take({.friction = 0.5});
  EXPECT_EQ(taken.friction, 0.5);
  EXPECT_EQ(taken.damping, 3.0);
}

TEST(Requests, KeepTheirBitsAsText) {
  for (const char* text :
       {R"({"do":"move","by":[0.1,-1e-300,0.3333333333333333]})", R"({"do":"grab","phyxel":12})",
        R"({"do":"set","gravity":[0.1,0.2,-9.81],"stiffness":1.7,"damping":0.3,"friction":0.1})",
        R"({"do":"drop"})", R"({"do":"reset"})", R"({"do":"save"})", R"({"do":"play"})",
        R"({"do":"step","count":3.0})", R"({"do":"show","field":"bodies"})"}) {
    const Request request = parse_request(text);
    EXPECT_EQ(parse_request(json_of(request).dump()), request) << text;
  }
}

TEST(Requests, ThatAreWrongSayWhatIsAllowed) {
  EXPECT_THAT(refusal_of("nonsense"), HasSubstr("one of grab, move"));
  EXPECT_THAT(refusal_of("{}"), HasSubstr("one of grab, move"));
  EXPECT_THAT(refusal_of(R"({"do": "fly"})"), HasSubstr("one of grab, move"));
  EXPECT_THAT(refusal_of(R"({"do": 3})"), HasSubstr("one of grab, move"));
  EXPECT_THAT(refusal_of(R"({"do": "grab"})"), HasSubstr("\"phyxel\" is missing"));
  EXPECT_THAT(refusal_of(R"({"do": "grab", "phyxel": 1.5})"), HasSubstr("whole number"));
  EXPECT_THAT(refusal_of(R"({"do": "grab", "phyxel": -1})"), HasSubstr("from 0 to"));
  EXPECT_THAT(refusal_of(R"({"do": "move", "by": [1, 2]})"), HasSubstr("three numbers"));
  EXPECT_THAT(refusal_of(R"({"do": "move", "by": [1, 2, 1e20]})"), HasSubstr("1e+20"));
  EXPECT_THAT(refusal_of(R"({"do": "move", "by": [1, 2, null]})"), HasSubstr("null"));
  EXPECT_THAT(refusal_of(R"({"do": "set", "stiffness": 0})"), HasSubstr("from 0.001 to 1000"));
  EXPECT_THAT(refusal_of(R"({"do": "drop", "phyxel": 1})"), HasSubstr("does not know"));
  EXPECT_THAT(refusal_of(R"({"do": "show", "field": 1})"), HasSubstr("allowed a name"));
}

Recording session() {
  Request grab{RequestKind::grab}, move{RequestKind::move};
  grab.phyxel = 4;
  move.by = {0.1, 0.2, 0.3};
  return {
      "phyxel 0.1.0",
      {0xfedcba9876543210, "float", "verlet", 0.1, {{"time.end", "1"}, {"gravity", "[0, 0, 1]"}}},
      {{12, grab}, {13, move}, {400, {RequestKind::drop}}, {401, {RequestKind::save}}}};
}

TEST(Recordings, ComeBackAsTheyWere) {
  const Recording written = session(), read = parse_recording(text_of(written), "s.jsonl");
  EXPECT_EQ(read.program, written.program);
  EXPECT_EQ(read.of.model, written.of.model);
  EXPECT_EQ(read.of.parameters, written.of.parameters);
  EXPECT_EQ(differences(written.of, read.of), "");
  EXPECT_EQ(read.acts, written.acts);
}

TEST(Recordings, OfOtherRunsSayWhatDiffers) {
  const RecordedRun then = session().of;
  RecordedRun now = then;
  now.dt = 0.05;
  EXPECT_THAT(differences(then, now), HasSubstr("time step [s]: 0.1 then, 0.05 now"));
  now = then;
  now.method = "implicit";
  EXPECT_THAT(differences(then, now), HasSubstr("verlet then, implicit now"));
  now = then;
  now.parameters[1].value = "[0, 0, 2]";
  EXPECT_THAT(differences(then, now), HasSubstr("gravity: [0, 0, 1] then, [0, 0, 2] now"));
  now = then;
  ++now.model;
  EXPECT_THAT(differences(then, now), HasSubstr("digest"));
}

TEST(Recordings, ThatAreWrongNameTheLine) {
  const std::string good = text_of(session());
  const auto refused = [](const std::string& text) -> std::string {
    try {
      parse_recording(text, "s.jsonl");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refused(""), HasSubstr("s.jsonl:1:"));
  // So deep that a parser which calls itself would overflow the stack.
  EXPECT_THAT(refused(good + "{\"step\": 500, \"do\": " + std::string(3'000'000, '[')),
              HasSubstr("s.jsonl:6: 3000"));
  EXPECT_THAT(refused("{\"format\": \"other\"}\n"), HasSubstr("\"other\""));
  EXPECT_THAT(refused(good + "{\"do\": \"drop\"}\n"), HasSubstr("s.jsonl:6: the key \"step\""));
  EXPECT_THAT(refused(good + "{\"step\": 500, \"do\": \"play\"}\n"),
              HasSubstr("s.jsonl:6: no act"));
  EXPECT_THAT(refused(good + "{\"step\": 500, \"do\": \"grab\"}\n"), HasSubstr("s.jsonl:6: "));
  EXPECT_THAT(refused(good + "{\"step\": 5, \"do\": \"drop\"}\n"), HasSubstr("s.jsonl:6: "));
  EXPECT_THAT(refused(good.substr(0, good.size() - 5)), HasSubstr("s.jsonl:5: "));
}

}  // namespace
}  // namespace phyxel::app

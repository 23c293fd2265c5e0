/// The list of laws: what every law promises, and what is refused of a material.
#include "phyxel/law_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "support/clouds.hpp"
#include "support/laws.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;
using testing::rubber;

/// The message of the refusal of a scene with this material.
std::string refusal_of(const Material& material) {
  return testing::refusal_of([&] { validate(testing::one_body(material)); });
}

TEST(LawTable, EveryLawHasANameOfItsOwnAndParametersThatAreToldApart) {
  std::set<std::string> names;
  for (const LawEntry& law : law_table()) {
    EXPECT_TRUE(names.insert(law.name).second) << law.name;
    EXPECT_NE(std::string(law.meaning), "");
    std::set<std::string> parameters;
    for (const LawParameter& p : law.parameters) {
      EXPECT_TRUE(parameters.insert(p.name).second) << law.name << ": " << p.name;
      EXPECT_LT(p.low, p.high) << law.name << ": " << p.name;
    }
  }
  EXPECT_EQ(law_table().size(), static_cast<std::size_t>(Laws::size));
}

/// The constants are those of the law's own order, and volume conservation stands behind them.
TEST(LawTable, ConstantsAreLamesParametersAndTheStiffnessOfVolumeConservation) {
  Material material = rubber();
  material.volume_stiffness = 4e4;
  for (const char* name :
       {"st-venant-kirchhoff", "small-strain", "neo-hookean", "corotated", "hencky"}) {
    material.law = name;
    const ChosenLaw law = chosen_law(material);
    EXPECT_EQ(std::string(law_table()[law.index].name), name);
    EXPECT_EQ(law.constants[0], material.lame_lambda());
    EXPECT_EQ(law.constants[1], material.lame_mu());
    EXPECT_EQ(law.constants[2], 4e4);
    // λ + 2μ + k_v; a law adds it up in its own order.
    const double expected = material.lame_lambda() + 2 * material.lame_mu() + 4e4;
    EXPECT_NEAR(wave_stiffness_at_rest(material), expected, 1e-15 * expected);
    EXPECT_EQ(hourglass_modulus(material), material.young);
  }
}

/// The linear law at rest has the stress of the law at small strains, volume conservation included.
TEST(LawTable, TheLawAtRestIsTheTangentAtRest) {
  for (const LawEntry& entry : law_table()) {
    Material material = testing::rubber_of(entry.name);
    material.volume_stiffness = 3e4;
    const ChosenLaw chosen = chosen_law(material);
    Laws::with<double>(chosen.index, chosen.constants.data(), [&](const auto& law) {
      const HistoryOf<std::decay_t<decltype(law)>> virgin{};
      const auto linear = law.at_rest(material.volume_stiffness);
      const VolumeConservation<double> volume{material.volume_stiffness};
      const double step = 1e-7;
      for (int e = 0; e < 9; ++e) {
        Mat3d g{};
        g(e / 3, e % 3) = step;
        const Mat3d p = elastic_stress(law, g, virgin) + volume.first_piola_stress(g),
                    q = linear.first_piola_stress(g);
        // Terms of second order are a ten-millionth of the stress of a modulus of 1e5 Pa.
        for (int k = 0; k < 9; ++k) {
          EXPECT_NEAR(p(k / 3, k % 3), q(k / 3, k % 3), 1e-6 * 2e5 * step) << entry.name;
        }
      }
    });
  }
}

/// c10, c01 and the bulk modulus say what E, λ and μ are; E and ν of the material do not count.
TEST(LawTable, ALawWithoutYoungsModulusHasItsOwn) {
  Material material = testing::rubber_of("mooney-rivlin");
  material.parameters = {{"c10", 3e4}, {"c01", 1e4}, {"bulk_modulus", 2e5}};
  const double mu = 8e4, lambda = 2e5 - 2 * mu / 3;
  EXPECT_NEAR(wave_stiffness_at_rest(material), lambda + 2 * mu, 1e-15 * lambda);
  EXPECT_NEAR(hourglass_modulus(material), mu * (3 * lambda + 2 * mu) / (lambda + mu), 1e-9);
  material.young = material.poisson = 0;
  EXPECT_EQ(refusal_of(material), "accepted");
}

/// Each within its range, and together not: L = K + 2/3 c10 - 4/3 c01 has to be positive.
TEST(LawTable, RefusesParametersThatDoNotGoTogether) {
  Material material = testing::rubber_of("mooney-rivlin");
  material.parameters = {{"c10", 1e4}, {"c01", 3e4}, {"bulk_modulus", 3.4e4}};
  EXPECT_EQ(refusal_of(material), "accepted");
  material.parameters["bulk_modulus"] = 3.3e4;
  EXPECT_THAT(refusal_of(material),
              HasSubstr("c10 = 10000, c01 = 30000, bulk_modulus = 33000 found, which law "
                        "\"mooney-rivlin\" does not allow together; allowed: "
                        "bulk_modulus > 4/3 c01 - 2/3 c10"));
}

TEST(LawTable, RefusesWhatALawDoesNotHave) {
  Material material = rubber();
  EXPECT_EQ(refusal_of(material), "accepted");
  material.law = "corotate";
  EXPECT_THAT(refusal_of(material), HasSubstr("law \"corotate\" found"));
  EXPECT_THAT(refusal_of(material), HasSubstr("corotated"));
  material = rubber();
  material.parameters["yield"] = 1;
  EXPECT_THAT(refusal_of(material),
              HasSubstr("yield = 1 found, which law \"st-venant-kirchhoff\" does not have"));
  material = rubber();
  material.poisson = 0.5;
  EXPECT_THAT(refusal_of(material), HasSubstr("poisson"));
  EXPECT_THROW(chosen_law(material), InputError);
}

}  // namespace
}  // namespace phyxel

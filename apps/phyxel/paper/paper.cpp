/// Functions that the measurements of `phyxel paper` share.
#include "paper.hpp"

#include <fmt/format.h>

#include <cmath>

#include "markdown.hpp"
#include "outside_text.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/physics/laws.hpp"

namespace phyxel::app {

namespace fs = std::filesystem;

fs::path table_file(const fs::path& folder, const std::string& table) {
  return folder / (table + ".csv");
}

std::optional<CsvTable> read_table(const fs::path& folder, const std::string& table) {
  const fs::path file = table_file(folder, table);
  if (!fs::exists(file)) return std::nullopt;
  return read_page_table(file);
}

Facts paper_facts(const PaperRequest& request) {
  Facts facts = machine_facts();
  facts.emplace_back("gpu", request.gpu ? request.gpu->describe() : "none");
  facts.emplace_back("cuda", cuda_version());
  return facts;
}

std::vector<PaperProgram> paper_programs(const PaperRequest& request) {
  std::vector<PaperProgram> list{
      {"sequential of 2008", "float", paper::make_sequential_backend<float>},
      {"sequential of 2008", "double", paper::make_sequential_backend<double>}};
  if (!request.gpu) return list;
  for (const Precision precision : {Precision::single, Precision::double_}) {
    for (const auto store : {paper::ForceStore::dense, paper::ForceStore::csr}) {
      list.push_back({store == paper::ForceStore::dense ? "kernels of 2008" : "CSR gather",
                      precision_name(precision), [=, &request](const Model& model) {
                        return paper::make_gpu_backend(
                            model,
                            {.precision = precision, .store = store, .device = request.gpu->index});
                      }});
    }
  }
  return list;
}

Model paper_block(Index n) {
  const double side = std::ceil(std::cbrt(n)) * 0.1;
  Cloud cloud = make_shape({.name = "block",
                            .size = {side, side, side},
                            .spacing = 0.1,
                            .jitter = 0.1,
                            .surface = false});
  cloud.position.resize(static_cast<std::size_t>(n));
  cloud.volume.clear();
  cloud.regions.clear();
  Scene scene;
  scene.gravity = {0, 0, -9.81};
  BodyRequest body;
  body.name = fmt::format("block of {}", n);
  body.where = "phyxel paper";
  body.material = {.young = 1e5,
                   .poisson = 0.34,
                   .density = 1000,
                   .law = StVenantKirchhoff<double>::name,
                   .hourglass = 0};
  paper::use_paper_rules(body);
  scene.bodies.push_back(body);
  return paper::paper_model(scene, cloud);
}

}  // namespace phyxel::app

// Recognition by sections alone, over many laps: no gate by the graph, no registration. The sections of one lap through
// a folder of the tunnel simulator (with true poses) are the map; laps made of them anew (another lane, other stations,
// noise, gaps, things that stand there) ask where they are. A study, no test.
//   recognition_study FOLDER POSES.tum [laps=100] [scans=N] [every=2] [least_score=0.35] [rival_share=0.8]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>
#include <string>

#include "components/dataset/dataset.hpp"
#include "components/dataset/point_file.hpp"
#include "components/mapping/keyframes.hpp"

using namespace adit;
using namespace adit::mapping;

namespace {

std::vector<Section> sections_of(const dataset::Dataset& dataset, const Trajectory& poses, std::size_t scans,
                                 std::size_t every) {
  KeyframeBuilder builder;
  std::vector<Section> out;
  Points points;
  std::vector<float> seconds;
  for (std::size_t n = 0; n < std::min(scans, dataset.entries.size()); n += every) {
    const auto file = dataset::read_bin(dataset.entries[n].path, dataset.entries[n].points);
    if (!file || file->fields.size() < 5) continue;
    points.clear();
    seconds.clear();
    for (std::size_t i = 0; i < file->points; ++i) {
      const float* row = &file->values[i * file->fields.size()];
      points.push_back({{row[0], row[1], row[2]}, row[3]});
      seconds.push_back(row[4]);
    }
    if (builder.add({dataset.entries[n].stamp_ns, points, seconds}, poses) == KeyframeBuilder::Outcome::keyframe) {
      out.insert(out.end(), builder.sections().begin(), builder.sections().end());
    }
  }
  return out;
}

// The same way driven again: up to 0.3 m beside the old lane, stations shifted by up to 0.5 m, 4 cm and 8 % of noise on
// a sector's means, 10 % of them missing, and every 40 m or so something 3 m long on one side.
std::vector<Section> again(const std::vector<Section>& lap, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> unit;
  const float aside = 0.3F * (2.0F * unit(random) - 1.0F), shift = unit(random);
  std::vector<Section> out;
  int standing = 0;
  std::size_t side = 0;
  for (std::size_t k = 0; k + 1 < lap.size(); ++k) {
    if (standing > 0) {
      --standing;
    } else if (unit(random) < 1.0F / 80.0F) {
      standing = 6;
      side = unit(random) < 0.5F ? 0 : sectors / 2;
    }
    Section section;
    for (std::size_t s = 0; s < sectors; ++s) {
      const float a = lap[k].radius[s], b = lap[k + 1].radius[s];
      if (a == 0.0F || b == 0.0F || unit(random) < 0.1F) continue;
      const float angle = (static_cast<float>(s) + 0.5F) * 2.0F * static_cast<float>(M_PI) / sectors;
      section.radius[s] = (1.0F - shift) * a + shift * b - aside * std::cos(angle) + 0.04F * normal(random);
      const float reflectivity = (1.0F - shift) * lap[k].reflectivity[s] + shift * lap[k + 1].reflectivity[s];
      section.reflectivity[s] = reflectivity * (1.0F + 0.08F * normal(random));
      const std::size_t from_side = std::min((s + sectors - side) % sectors, (side + sectors - s) % sectors);
      if (standing > 0 && from_side < 5) section.radius[s] = 0.6F * section.radius[s];
    }
    out.push_back(section);
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: recognition_study FOLDER POSES.tum [key=value ...]\n");
    return 2;
  }
  std::map<std::string, double> options{
      {"laps", 100}, {"scans", 1e9}, {"every", 2}, {"least_score", 0.35}, {"rival_share", 0.8}};
  for (int i = 3; i < argc; ++i) {
    const std::string text = argv[i];
    options[text.substr(0, text.find('='))] = std::atof(text.substr(text.find('=') + 1).c_str());
  }
  const auto dataset = dataset::open_dataset(argv[1], 10.0);
  const auto poses = read_tum(argv[2]);
  if (!dataset || !poses) {
    std::fprintf(stderr, "%s\n", (!dataset ? dataset.error() : poses.error()).message.c_str());
    return 1;
  }
  const std::vector<Section> lap = sections_of(*dataset, *poses, static_cast<std::size_t>(options["scans"]),
                                               static_cast<std::size_t>(options["every"]));
  std::size_t asked = 0, found = 0, wrong = 0, ambiguous = 0;
  double best_wrong = 0.0, worst_right = 1.0;
  constexpr std::size_t asked_every = 16;  // sections: 8 m
  constexpr std::size_t same_place = 6;    // sections: 3 m
  for (int n = 0; n < static_cast<int>(options["laps"]); ++n) {
    SectionHistory history;
    for (const Section& s : lap) history.add(s);
    const std::size_t before = lap.size();
    for (const Section& s : again(lap, static_cast<unsigned>(n) + 1)) history.add(s);
    const auto off = [&](const SectionMatch& m, std::size_t k) { return m.end > k ? m.end - k : k - m.end; };
    for (std::size_t k = history.config().window; before + k < history.ready(); k += asked_every) {
      ++asked;
      const auto peaks = history.search(before + k, before, 2);
      if (peaks.empty()) continue;
      for (const SectionMatch& peak : peaks) {
        if (peak.reversed || off(peak, k) > same_place) best_wrong = std::max(best_wrong, peak.score);
      }
      if (peaks[0].score < options["least_score"]) continue;
      if (peaks.size() > 1 && peaks[1].score > options["rival_share"] * peaks[0].score) {
        ++ambiguous;
      } else if (peaks[0].reversed || off(peaks[0], k) > same_place) {
        ++wrong;
      } else {
        ++found;
        worst_right = std::min(worst_right, peaks[0].score);
      }
    }
  }
  std::printf("%zu sections (%.0f m), %g laps: asked %zu, recognized %zu (%.1f %%), ambiguous %zu, wrong %zu\n",
              lap.size(), section_spacing * static_cast<double>(lap.size()), options["laps"], asked, found,
              100.0 * static_cast<double>(found) / static_cast<double>(std::max<std::size_t>(1, asked)), ambiguous,
              wrong);
  std::printf("best score of a wrong place %.2f, lowest of a right one that was taken %.2f\n", best_wrong, worst_right);
  return 0;
}

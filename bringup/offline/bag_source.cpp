#include "bringup/offline/source.hpp"
#include "components/dataset/bag_reader.hpp"

namespace adit::offline {
namespace {

class BagSource final : public Source {
 public:
  BagSource(std::unique_ptr<dataset::BagReader> reader, std::int64_t end_ns)
      : reader_(std::move(reader)), end_ns_(end_ns) {}

  Time begin() const override { return Time(Duration(reader_->info().first_ns)); }
  Time end() const override { return Time(Duration(end_ns_)); }

  Result<bool> next(OfflineMessage& out) override {
    dataset::BagSample sample;
    const Result<bool> more = reader_->next(sample);
    if (!more || !*more || sample.stamp_ns > end_ns_) return more ? Result<bool>(false) : more;
    out = OfflineMessage{};
    out.topic = reader_->info().topics[sample.topic].name;
    out.stamp = Time(Duration(sample.stamp_ns));
    out.cdr = sample.cdr;  // valid until the next call: inputs copy what they need
    return true;
  }

 private:
  std::unique_ptr<dataset::BagReader> reader_;
  std::int64_t end_ns_;
};

}  // namespace

Result<std::unique_ptr<Source>> open_bag(const std::string& path, const SourceOptions& options) {
  Result<std::unique_ptr<dataset::BagReader>> reader = dataset::BagReader::open(path);
  if (!reader) return reader.error();
  const std::vector<std::string> topics(options.topics.begin(), options.topics.end());
  if (Result<void> selected = (*reader)->select(topics); !selected) return selected.error();
  const dataset::BagInfo& info = (*reader)->info();
  std::int64_t end_ns = info.last_ns;
  if (options.duration_s > 0.0) {
    end_ns = std::min(end_ns, info.first_ns + static_cast<std::int64_t>(1e9 * options.duration_s));
  }
  return std::unique_ptr<Source>(new BagSource(*std::move(reader), end_ns));
}

}  // namespace adit::offline

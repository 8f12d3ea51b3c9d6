// Writes rosbag2 bags: a folder with one SQLite file (database schema 4) and metadata.yaml (version 8), read by ROS 2
// Iron and later with types and hashes, by Humble without.
#pragma once

#include <memory>
#include <string>

#include "components/dataset/bag.hpp"
#include "idl/result.hpp"

namespace adit::dataset {

// One thread. The same calls make the same bytes. Samples may come in any order of their stamps.
class BagWriter {
 public:
  // When what was written is safe on the disk: on close(), for files that are made again if the machine dies (fastest);
  // or with each commit, for recordings: a killed process or a power cut leaves a bag that can be read up to there.
  enum class Safety { on_close, each_commit };

  // Creates the folder; a bag of the same name in it is replaced. Anything else there is left alone.
  static Result<std::unique_ptr<BagWriter>> create(const std::string& folder, Safety safety = Safety::on_close);
  // Closes what was not closed, without telling whether that worked.
  ~BagWriter();

  // The topic's index for write(). A name that is there already must have the same type.
  Result<std::size_t> add_topic(const BagTopic& topic);
  // The bytes are stored during the call.
  Result<void> write(const BagSample& sample);
  // Ends a group of writes; happens by itself every 512 samples or 64 MB.
  Result<void> commit();
  // Writes metadata.yaml and ends the bag; no write afterwards.
  Result<void> close();

 private:
  struct Impl;
  explicit BagWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::dataset

#pragma once

#include <rviz/panel.h>

#include <QStringList>
#include <string>
#include <vector>

class QLabel;
class QLineEdit;
class QPushButton;

namespace tunnel_pilot::hud {

class BagRecorder;
class ServiceCaller;

/// The rviz panel tunnel_pilot/Panel: the operator's edges as buttons, with the answer in words, and a
/// recorder. Calls `engage`, `release`, `stop` and `reset` (std_srvs/Trigger) of the bridge; where there
/// is none, `arbiter/stop` and `arbiter/reset`. The folder and the topics that are recorded are kept in
/// rviz' configuration.
class Panel : public rviz::Panel {
  Q_OBJECT

 public:
  explicit Panel(QWidget* parent = nullptr);

  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

 private:
  QPushButton* addButton(const char* name, const char* tip, std::vector<std::string> services);
  QWidget* makeRecorder();
  void toggleRecording();
  void chooseFolder();

  QStringList topics_;
  ServiceCaller* caller_;
  BagRecorder* recorder_;
  QLabel* answer_;
  QPushButton* record_;
  QLineEdit* folder_;
  QLabel* recording_;
};

}  // namespace tunnel_pilot::hud
